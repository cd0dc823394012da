"""A job in a process of its own that is killed, or told to end, at one of its system calls.

By ptrace, so that every change of a file or folder is met, whoever makes it: Python, HDF5 or the C
library; a filter of seccomp lets all other calls pass at full speed. Between two changes what is on
disk stays the same, so kills before each of them meet every state in which a kill can leave it.
"""

import contextlib
import ctypes
import os
import platform
import signal
import struct
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

Job = Callable[[], int]  # the exit code of its process

_OPEN = {"x86_64": {2: 1, 257: 2}, "aarch64": {56: 2}}  # the call: its argument with the flags
_WRITE = {"x86_64": {1, 18, 20}, "aarch64": {64, 66, 68}}  # write, pwrite64, writev
# flock, fsync, truncate, rename, mkdir, rmdir, link, unlink, symlink, chmod, and their variants
_CHANGE = {
    "x86_64": {73, 74, 75, 76, 77, 82, 83, 84, 85, 86, 87, 88, 90, 258, 263, 264, 265, 266, 316},
    "aarch64": {32, 34, 35, 36, 37, 38, 45, 46, 52, 82, 83, 276},
}
_MACHINE = platform.machine() if sys.platform == "linux" else ""

_TRACEME, _CONT, _SETOPTIONS, _CALL_INFO = 0, 7, 0x4200, 0x420E
_TRACE_SECCOMP, _KILL_WITH_TRACER = 0x80, 0x100000
_AT_CALL = signal.SIGTRAP | 7 << 8
_NO_NEW_PRIVILEGES, _SECCOMP, _FILTER = 38, 22, 2
_LOAD, _JUMP_IF, _RETURN, _PASS, _TRACE = 0x20, 0x15, 0x06, 0x7FFF0000, 0x7FF00000


class _Call(ctypes.Structure):
    _fields_ = (
        ("head", ctypes.c_uint64 * 3),
        ("number", ctypes.c_uint64),
        ("arguments", ctypes.c_uint64 * 6),
        ("tail", ctypes.c_uint64),
    )

    def changes_files(self) -> bool:
        if (flags := _OPEN[_MACHINE].get(self.number)) is not None:
            return bool(self.arguments[flags] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
        return self.number not in _WRITE[_MACHINE] or self.arguments[0] > 2


@dataclass(frozen=True)
class Stopped:
    """How a job ended: its exit code, negative for a signal; ``reached``: the call was made."""

    code: int
    reached: bool


def stopped_at(job: Job, call: int, number: signal.Signals) -> Stopped:
    """Run ``job`` and send it ``number`` as it is about to make its ``call``-th change (from 1)."""
    pid = _started(job)
    _ptrace(_SETOPTIONS, pid, _TRACE_SECCOMP | _KILL_WITH_TRACER)
    count, pending = 0, 0
    while True:
        with contextlib.suppress(ProcessLookupError):  # it is dead already
            _ptrace(_CONT, pid, pending)
        _, status = os.waitpid(pid, 0)
        if not os.WIFSTOPPED(status):
            return Stopped(os.waitstatus_to_exitcode(status), count >= call)
        pending = os.WSTOPSIG(status)
        if status >> 8 == _AT_CALL:
            pending = 0
            count += _is_at_change(pid)
            if count == call:
                os.kill(pid, number)
                count += 1


def _is_at_change(pid: int) -> bool:
    call = _Call()
    _ptrace(_CALL_INFO, pid, ctypes.addressof(call), ctypes.sizeof(call))
    return call.changes_files()


def stopped_after(job: Job, seconds: float, number: signal.Signals) -> int:
    """Run ``job`` and send it ``number`` after so long; its exit code, negative for a signal."""
    pid = _forked(job, lambda: None)
    time.sleep(seconds)
    os.kill(pid, number)  # to nobody else: it is not waited for yet
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def _started(job: Job) -> int:
    """A process that is about to do the job, stopped."""
    pid = _forked(job, _wait_for_tracer)
    os.waitpid(pid, 0)
    return pid


def forked(job: Job) -> int:
    """The number of a process that does the job; its exit code is 1 where the job raises."""
    if pid := os.fork():
        return pid
    code = 1
    try:
        code = job()
    except KeyboardInterrupt:
        code = 130
    finally:
        os._exit(code)


def _forked(job: Job, prepare: Callable[[], None]) -> int:
    def work() -> int:
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in range(3):
            os.dup2(nowhere, stream)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        for number in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)
        prepare()
        return job()

    return forked(work)


def _wait_for_tracer() -> None:
    _ptrace(_TRACEME, 0, 0)
    _stop_at_changes()
    os.kill(os.getpid(), signal.SIGSTOP)


def _stop_at_changes() -> None:
    """From now on this process stops for its tracer at the calls that may change a file."""
    numbers = sorted({*_OPEN[_MACHINE], *_WRITE[_MACHINE], *_CHANGE[_MACHINE]})
    program = [(_LOAD, 0, 0, 0)]  # the number of the call
    program += [(_JUMP_IF, len(numbers) - k, 0, number) for k, number in enumerate(numbers)]
    program += [(_RETURN, 0, 0, _PASS), (_RETURN, 0, 0, _TRACE)]
    code = b"".join(struct.pack("=HBBI", *line) for line in program)
    text = ctypes.create_string_buffer(code)
    filters = struct.pack("@HP", len(program), ctypes.addressof(text))
    prctl = ctypes.CDLL(None, use_errno=True).prctl
    prctl.argtypes = (ctypes.c_int, *[ctypes.c_void_p] * 4)
    at = ctypes.create_string_buffer(filters)
    for how in ((_NO_NEW_PRIVILEGES, 1, 0), (_SECCOMP, _FILTER, ctypes.addressof(at))):
        if prctl(*how, 0, 0):
            raise OSError(ctypes.get_errno(), "no filter of system calls")


def _ptrace(request: int, pid: int, data: int, address: int = 0) -> None:
    call = ctypes.CDLL(None, use_errno=True).ptrace
    call.argtypes = (ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p)
    call.restype = ctypes.c_long
    if call(request, pid, address, data) == -1:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))


def _open_to_write() -> int:
    os.close(os.open(os.devnull, os.O_WRONLY))
    return 0


def can_stop() -> bool:
    """Whether this works here: Linux on a machine that is known, where ptrace is allowed."""
    if _MACHINE not in _CHANGE:
        return False
    with contextlib.suppress(OSError):
        killed = stopped_at(_open_to_write, 1, signal.SIGKILL)
        return killed == Stopped(-signal.SIGKILL, True)
    return False
