"""A client of a live run: the WebSocket of `boresight view SCENARIO.json` as its page uses it (RFC 6455)."""
import base64
import json
import os
import struct

import numpy


class Socket:
    """One connection. Its first answer says whether it controls the run."""

    def __init__(self, viewer, path="/{token}/live", host="127.0.0.1:{port}", origin="http://127.0.0.1:{port}"):
        self.peer = viewer.connect()
        words = {"token": viewer.token, "port": viewer.port}
        lines = [f"GET {path.format(**words)} HTTP/1.1", f"Host: {host.format(**words)}", "Upgrade: websocket", "Connection: Upgrade",
                 "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: " + base64.b64encode(bytes(16)).decode()]
        lines += [f"Origin: {origin.format(**words)}"] if origin else []
        self.peer.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        self.rest = b""
        while b"\r\n\r\n" not in self.rest:
            more = self.peer.recv(65536)
            if not more:
                break
            self.rest += more
        head, _, self.rest = self.rest.partition(b"\r\n\r\n")
        self.status = int(head.split()[1]) if head else 0
        self.sequence = 0

    def close(self):
        self.peer.close()

    def send(self, data, opcode=0x81):
        if len(data) < 126:
            head = struct.pack(">BB", opcode, 0x80 | len(data))
        else:
            head = struct.pack(">BBH", opcode, 0x80 | 126, len(data))
        mask = os.urandom(4)
        self.peer.sendall(head + mask + bytes(byte ^ mask[k % 4] for k, byte in enumerate(data)))

    def read(self, count):
        while len(self.rest) < count:
            more = self.peer.recv(1 << 20)
            if not more:
                raise ConnectionError("the server has closed the connection")
            self.rest += more
        data, self.rest = self.rest[:count], self.rest[count:]
        return data

    def receive(self):
        """Opcode and content of a message."""
        first, length = self.read(2)
        if length == 126:
            length, = struct.unpack(">H", self.read(2))
        elif length == 127:
            length, = struct.unpack(">Q", self.read(8))
        return first & 15, self.read(length)

    def ask(self, command=None, **more):
        """Sends a request; answer and pixels."""
        asked = {"sensor": 0, "after": self.sequence, **more}
        if command:
            asked["command"] = command
        self.send(json.dumps(asked).encode())
        opcode, data = self.receive()
        if opcode != 2:
            raise ConnectionError(f"opcode {opcode}")
        length, = struct.unpack("<I", data[:4])
        answer = json.loads(data[4:4 + length])
        pixels = numpy.frombuffer(data[4 + length:], "<u2")
        if answer["sequence"]:
            self.sequence = answer["sequence"]
        return answer, pixels.reshape(answer["height"], answer["width"]) if pixels.size else None

    def state(self, until=None, command=None):
        """State of the run after a command was obeyed, once it fits a condition."""
        state = self.ask()[0]["state"]
        obeyed = state["obeyed"]
        if command:
            state = self.ask(command)[0]["state"]
        while (command and state["obeyed"] == obeyed) or (until and not until(state)):
            state = self.ask()[0]["state"]
        return state
