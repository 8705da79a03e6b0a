"""The signals that end the node's process."""

from __future__ import annotations

import os
import signal
import threading

from rclpy.task import Future


def shutdown_requested() -> Future[None]:
    """Make a future that is done after SIGINT, SIGTERM or SIGHUP. Call this in the main thread.

    SIGHUP is sent when the terminal is closed. If it is ignored at the start, as by ``nohup``, it stays
    ignored.

    rclpy's own signal handlers are not used: they wake the executor before they shut the context down, so it
    may go to sleep again for ever, and they shut the context down while the node still needs it. A Python
    handler would not run while the main thread waits for DDS. What Python writes to the wake-up pipe arrives
    at once.
    """
    stop: Future[None] = Future()
    source, sink = os.pipe()
    os.set_blocking(sink, False)
    signal.set_wakeup_fd(sink)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, lambda *_: None)

    def wait() -> None:
        os.read(source, 1)
        stop.set_result(None)

    threading.Thread(target=wait, name="signals", daemon=True).start()
    return stop
