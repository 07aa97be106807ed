"""A link between two network namespaces that takes its time and loses packets: two TUN devices, and this process between them.

    slow_link.py NAMESPACE ADDRESS NAMESPACE ADDRESS DELAY_S LOSS

Says `ready` when both ends are up. When its stdin is closed it prints how many packets it passed on and lost, and ends.
"""

import fcntl
import heapq
import os
import random
import select
import struct
import subprocess
import sys
import time

TUNSETIFF, IFF_TUN, IFF_NO_PI = 0x400454CA, 0x0001, 0x1000


def end_of_link(name, namespace, address):
    tun = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(tun, TUNSETIFF, struct.pack("16sH22x", name.encode(), IFF_TUN | IFF_NO_PI))
    for command in (
        f"ip link set {name} netns {namespace}",
        f"ip -n {namespace} addr add {address} dev {name}",
        f"ip -n {namespace} link set {name} up",
    ):
        subprocess.run(command.split(), check=True)
    return tun


def main():
    one, one_address, other, other_address, delay_s, loss = sys.argv[1:]
    delay_s, loss = float(delay_s), float(loss)
    ends = [end_of_link(f"bl{os.getpid()}a", one, one_address), end_of_link(f"bl{os.getpid()}b", other, other_address)]
    print("ready", flush=True)
    lots, under_way, passed, lost = random.Random(1), [], 0, 0
    while True:
        wait_s = max(0.0, under_way[0][0] - time.monotonic()) if under_way else None
        ready, _, _ = select.select([*ends, 0], [], [], wait_s)
        for fd in ready:
            if fd == 0:
                print(passed, lost)
                return
            packet = os.read(fd, 65536)
            if lots.random() < loss:
                lost += 1
                continue
            passed += 1
            heapq.heappush(under_way, (time.monotonic() + delay_s, passed, ends[1 - ends.index(fd)], packet))
        while under_way and under_way[0][0] <= time.monotonic():
            _, _, end, packet = heapq.heappop(under_way)
            os.write(end, packet)


main()
