"""What a consumer in Python may rely on, beside a run of the name `run` whose process is PID.

    python check_live.py SCENARIO PID

Exit code 0 if `examples/python/beadline_live.py` does what is expected in this scenario.
"""

import os
import signal
import sys

from beadline_live import DONE, Lost, NoRun, Run, RunError


def raises(kind, words, act):
    try:
        act()
    except kind as error:
        assert words in str(error), f"{error}: expected {words}"
        return
    raise AssertionError(f"no {kind.__name__}")


def follow(run, then=lambda count: None):
    """Receives to the end, and checks that no frame is passed over."""
    count = 0
    for frame in run:
        assert frame.frame == run.first_frame + count and frame.missed == 0, frame.frame
        count += 1
        then(count)
    return count


def missing(_pid):
    raises(NoRun, "no run nobody was published within 0.2 s", lambda: Run("nobody", timeout=0.2))
    assert Run().name == "run", "the only run there is"


def late(pid):
    """In the middle of a run."""
    with Run("run") as first:
        while next(first).frame < 100:
            pass
    with Run("run") as run:
        assert run.first_frame > 100, run.first_frame
        count = follow(run, lambda count: count == 100 and os.kill(pid, signal.SIGTERM))
    assert count >= 100 and (run.end, run.missed) == ("interrupted", 0), run.end


def latest(_pid):
    """It never holds the run back, and counts what it does not get: here it takes nothing until the run is over."""
    with Run("run", latest=True) as run, Run("run") as helper:
        follow(helper)
        frames = list(run)
        last = run.manifest["physics"]["step_count"]
    assert (run.end, len(frames) + run.missed) == ("complete", last + 1 - run.first_frame), run.missed


def held(_pid):
    """Who holds more than two frames is told so; arrays stay readable when the run and the consumer are gone."""
    run, kept = Run("run"), []
    raises(RunError, "copy what you keep", lambda: kept.extend(run))
    assert [frame.frame for frame in kept] == [0, 1]
    first = kept[0]
    run.close()
    del run, kept
    assert (first.u.any(), first.v[0], first.v[1:].any()) == (False, 5.0, False), first.v
    assert not first.v.flags.writeable and not first.v.flags.owndata


def interrupted(pid):
    with Run("run") as run:
        count = follow(run, lambda count: count == 100 and os.kill(pid, signal.SIGTERM))
    assert count >= 100 and (run.end, run.missed) == ("interrupted", 0), run.end


def killed(pid):
    with Run("run") as run:
        raises(Lost, "producer lost", lambda: follow(run, lambda count: count == 100 and os.kill(pid, signal.SIGKILL)))
        assert (run.end, run.missed, list(run)) == ("producer lost", 0, []), run.missed


def stuck(_pid):
    """Who takes nothing for longer than the run allows is told so, and what it misses is counted."""
    with Run("run") as run:
        first = next(run).frame

        def wait_until_dropped(count):
            while count == 10 and not run.status().evicted and run.status().state < DONE:
                signal.sigtimedwait([], 0.01)

        run.first_frame = first + 1
        raises(Lost, "dropped", lambda: follow(run, wait_until_dropped))
        assert run.end == "dropped" and run.missed > 0


def stopped(pid):
    """Ctrl-C while nothing comes."""
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    with Run("run") as run:
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        raises(KeyboardInterrupt, "", lambda: next(run))
    os.kill(pid, 0)


globals()[sys.argv[1]](int(sys.argv[2]))
