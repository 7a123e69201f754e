"""Priority: what is reported is what the system has granted, to every thread but the one that sends later."""

import os

import pytest
from conftest import ran

OWN = f"{{{os.getpriority(os.PRIO_PROCESS, 0)}}}"  # niceness of the tests, which a started program inherits
PROGRAM = """
import ctypes, os, resource, sys, threading
from wam_ros.priority import SESSION, set_priority
fifo, nice, permitted = map(int, sys.argv[1:])
if not permitted:
    for limit in (resource.RLIMIT_RTPRIO, resource.RLIMIT_NICE):
        resource.setrlimit(limit, (0, 0))
    if os.getuid() == 0:
        os.setuid(65534)
        ctypes.CDLL(None).prctl(4, 1)  # PR_SET_DUMPABLE, as after exec
begin = lambda: threading.Thread(target=threading.Event().wait, daemon=True).start()
begin()
named = threading.Event()
def sends_later():
    ctypes.CDLL(None).prctl(15, b"dds.asyn.0.0")  # PR_SET_NAME, as the middleware does
    named.set()
    threading.Event().wait()
later = threading.Thread(target=sends_later, daemon=True)
later.start()
named.wait()
print(set_priority(fifo, nice))
begin()  # as the executor does
threads = [int(thread) for thread in os.listdir("/proc/self/task")]
assert os.sched_getscheduler(later.native_id) == os.SCHED_OTHER
print({os.sched_getscheduler(thread) == os.SCHED_FIFO for thread in threads if thread != later.native_id})
print({os.getpriority(os.PRIO_PROCESS, thread) for thread in threads})
print(SESSION.read_text().split()[-1] if SESSION.exists() else 0)
"""

GIVEN_BACK = """
import os, sys
from wam_ros import priority
ticks = iter(((0.0, 0.0), (1.0, 1.9), (2.1, float(sys.argv[1]))))
priority.spent = lambda: next(ticks)
own = priority.Priority()
before = os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)
own.ask(10, -15)
print(own.granted)
print(own.look(), own.look(), own.granted)
print((os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)) == (before[0], max(0, before[1])))
"""


def told(fifo: int, niceness: int, permitted: bool) -> tuple[str, ...]:
    """What a process reports; whether its threads have FIFO, their niceness, that of its session."""
    words = (str(number) for number in (fifo, niceness, int(permitted)))
    done = ran("-c", PROGRAM, *words, check=True, start_new_session=True)
    return tuple(done.stdout.splitlines())


@pytest.mark.parametrize("permitted", [True, False])
@pytest.mark.parametrize("asked", [(0, 0), (0, -15), (10, 0), (10, -15)])
def test_what_is_reported_is_what_every_thread_has(asked: tuple[int, int], permitted: bool) -> None:
    answers = {
        "SCHED_FIFO 10": ("SCHED_FIFO 10", "{True}", OWN, "0"),
        "nice -15 with its session": ("nice -15 with its session", "{False}", "{-15}", "-15"),
        "nice -15": ("nice -15", "{False}", "{-15}", "0"),
        "usual": ("usual", "{False}", OWN, "0"),
    }
    found = told(*asked, permitted)
    assert found == answers[found[0]]
    if asked == (0, 0) or not permitted:
        assert found[0] == "usual"
    if asked[0] == 0:
        assert "FIFO" not in found[0]


@pytest.mark.parametrize("used", [1.6, 1.8])
def test_a_process_that_takes_a_whole_processor_gives_its_priority_back(used: float) -> None:
    done = ran("-c", GIVEN_BACK, str(used), check=True, start_new_session=True)
    granted, looks, is_usual = done.stdout.splitlines()
    gives_back = granted != "usual" and used > 1.7
    assert looks == f"False {gives_back} {'usual' if gives_back or granted == 'usual' else granted}"
    assert is_usual == str(gives_back or granted == "usual")
