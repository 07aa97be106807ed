"""Writes random-numbers.csv: normal numbers and permutations from Philox4x32-10, in Python's integers and mpmath (pip install
mpmath).

Philox: J. K. Salmon and others, SC'11, doi:10.1145/2063384.2063405. Columns: the kind, seed, stream, index, and the normal number
rounded to a double, or the order.
"""

import sys

import mpmath

mpmath.mp.prec = 200
MASK = 0xFFFFFFFF


def philox(seed, stream, index):
    k0, k1 = seed & MASK, seed >> 32
    c0, c1, c2, c3 = index & MASK, index >> 32, stream, 0
    for _ in range(10):
        a, b = 0xD2511F53 * c0, 0xCD9E8D57 * c2
        c0, c1, c2, c3 = b >> 32 ^ c1 ^ k0, b & MASK, a >> 32 ^ c3 ^ k1, a & MASK
        k0, k1 = k0 + 0x9E3779B9 & MASK, k1 + 0xBB67AE85 & MASK
    return c0, c1, c2, c3


def bits(high, low):
    return (high >> 5 << 26) + (low >> 6)


def normal(seed, stream, index):
    w = philox(seed, stream, index)
    a, b = mpmath.mpf(bits(w[0], w[1]) + 1) / 2**53, mpmath.mpf(bits(w[2], w[3])) / 2**53
    return float(mpmath.sqrt(-2 * mpmath.log(a)) * mpmath.cos(2 * mpmath.pi * b))


def permutation(seed, stream, count):
    order = list(range(count))
    for i in range(count - 1, 0, -1):
        w = philox(seed, stream, i)
        place = (i + 1) * bits(w[0], w[1]) >> 53
        order[i], order[place] = order[place], order[i]
    return order


def main():
    assert philox(0, 0, 0) == (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)  # Random123's kat_vectors
    sys.stdout.write("kind,seed,stream,index,value\n")
    for n in range(200):
        seed, stream, index = n * 0x1234567_89ABCDEF & 2**64 - 1, n % 5, n * n * n * 104_729
        sys.stdout.write(f"normal,{seed},{stream},{index},{normal(seed, stream, index)!r}\n")
    for seed, count in enumerate([2, 3, 5, 10, 20, 50, 100, 200]):
        order = " ".join(map(str, permutation(seed, 3, count)))
        sys.stdout.write(f"permutation,{seed},3,,{order}\n")


main()
