"""A client of the event socket, as docs/protocol.md describes it."""

import json
import select
import socket
import time

from vm.basics import Failure, check, note
from vm.loopd import socket_path

ALL = ("loop", "candidate", "state", "stats")


class Closed(Failure):
    """The daemon has closed the connection."""


class Events:
    """One connection that watches `classes`. All that came is in `seen`."""

    def __init__(self, path=None, classes=ALL, since=None, within_s=20):
        self.seen = []
        self.bytes = b""
        self.waiting = []  # records that were read and not yet returned
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(within_s)
        self.socket.connect(path or socket_path())
        self.hello = self.next("hello", within_s)
        self.epoch = self.hello["epoch"]
        request = {"op": "watch", "classes": list(classes)}
        if since:
            request["since"] = since
        self.socket.sendall(json.dumps(request).encode() + b"\n")
        self.watch = self.next("watch", within_s)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def next(self, record_class, within_s, where=lambda record: True, what=None):
        """The next record of a class that fulfils a condition; what comes before is passed over."""
        deadline = time.monotonic() + within_s
        what = what or f"a {record_class} record"
        while True:
            record = self.read(deadline, what)
            if record["class"] == record_class and where(record):
                return record

    def state(self, state, within_s=20):
        """Waits until the daemon is in one of these states, or has just told that it is."""
        states = (state,) if isinstance(state, str) else state
        return self.next("state", within_s, lambda r: r["state"] in states, f"state {' or '.join(states)}")

    def frames(self, count, within_s=60):
        """Waits until the detector has had `count` more frames than now. Returns the last stats."""
        first = self.next("stats", within_s)["frames"]
        return self.next("stats", within_s, lambda r: r["frames"] >= first + count, f"{count} more frames")

    def read(self, deadline, what):
        """One record. Fails at the deadline, Closed if the connection ends."""
        while not self.waiting:
            left = deadline - time.monotonic()
            ready = left > 0 and select.select([self.socket], [], [], left)[0]
            check(ready, f"{what} did not come in time; the last records: {self.story()}")
            more = self.socket.recv(65536)
            if not more:
                raise Closed(f"the daemon closed the connection before {what} came")
            *lines, self.bytes = (self.bytes + more).split(b"\n")
            self.waiting = [json.loads(line) for line in lines]
        record = self.waiting.pop(0)
        self.seen.append(record)
        if record["class"] in ("state", "loop", "gap", "error"):
            note(brief(record))
        return record

    def closed(self, within_s):
        """Waits until the daemon closes the connection."""
        deadline = time.monotonic() + within_s
        try:
            while True:
                self.read(deadline, "the end of the connection")
        except (Closed, ConnectionError):
            pass

    def story(self):
        return [brief(record) for record in self.seen[-4:]]

    def loops(self):
        return [record for record in self.seen if record["class"] == "loop"]


def brief(record):
    if record["class"] == "loop":
        return f"loop: image {record['query']['id']} is {record['match']['id']}, {record['inliers']}"
    if record["class"] == "stats":
        return f"stats: {record['frames']} frames, {record['dropped']} dropped, {record['corrupt']} corrupt"
    return " ".join(f"{k}={v}" for k, v in record.items() if k in
                    ("class", "state", "cause", "message", "count", "repeat"))
