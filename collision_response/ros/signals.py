"""How the node's process is asked to end."""

from __future__ import annotations

import os
import signal
import threading

from rclpy.task import Future


def shutdown_requested() -> Future[None]:
    """A future that SIGINT, SIGTERM and SIGHUP complete. To be called in the main thread.

    SIGHUP is what comes when the terminal is closed; ``nohup`` has it ignored, and then it stays so.

    rclpy's own handlers wake the executor before they shut the context down, so now and then it
    goes to sleep again for ever; and they take the context from under the node. A handler in Python
    would not run while the main thread waits for DDS; what Python writes to the wake-up pipe
    arrives at once.
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
