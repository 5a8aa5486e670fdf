"""The 2DIY's protocol against the maker's own client, on one emulated board: both must send the same bytes.

    pip install HaplyHAPI pyserial
    python tests/references/two_diy_hapi.py target/debug/haptize

The board is emulated on a pseudo-terminal; no hardware takes part.
"""

import os
import pty
import struct
import subprocess
import sys
import threading
import tty
from pathlib import Path

import HaplyHAPI

# What the encoders measure, by port [deg].
ANGLES = {1: 12.5, 2: 168.25}


class Board:
    """Answers the commands of a 2DIY, and keeps their bytes."""

    def __init__(self) -> None:
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        self.path = os.ttyname(self.slave)
        self.setup, self.writes = b"", []
        threading.Thread(target=self.serve, daemon=True).start()

    def take(self, count: int) -> bytes:
        taken = b""
        while len(taken) < count:
            taken += os.read(self.master, count - len(taken))
        return taken

    def serve(self) -> None:
        while True:
            command, identity = self.take(2)
            if command == 1:
                self.setup = bytes([command, identity]) + self.take(24)
            elif command == 2:
                self.writes.append(bytes([command, identity]) + self.take(8))
                os.write(self.master, bytes([identity]) + struct.pack("<2f", ANGLES[1], ANGLES[2]))


def maker() -> Board:
    board = Board()
    device = HaplyHAPI.Device(5, HaplyHAPI.Board("test", board.path, 0))
    device.add_actuator(1, 1, 2)
    device.add_actuator(2, 1, 1)
    device.add_encoder(1, 1, 168, 4880, 2)
    device.add_encoder(2, 1, 12, 4880, 1)
    device.set_mechanism(HaplyHAPI.Pantograph())
    device.device_set_parameters()
    device.set_device_torques([0.0, 0.0])
    device.device_write_torques()
    device.device_read_data()
    angles = device.get_device_angles()
    assert abs(angles[0] - 168.25) < 1e-4 and abs(angles[1] - 12.5) < 1e-4, angles
    return board


def haptize(program: Path) -> Board:
    board = Board()
    done = subprocess.run(
        [program, "device", "check", f"2diy:{board.path}", "--seconds", "0.5", "--json"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert '"fresh"' in done.stdout
    return board


def main() -> None:
    theirs, ours = maker(), haptize(Path(sys.argv[1]).resolve())
    assert ours.setup == theirs.setup, (ours.setup.hex(" "), theirs.setup.hex(" "))
    assert set(ours.writes) == set(theirs.writes), (ours.writes[0].hex(" "), theirs.writes[0].hex(" "))
    print(f"setup of {len(ours.setup)} bytes and commands of zero torque equal those of HaplyHAPI; {len(ours.writes)} exchanges")


if __name__ == "__main__":
    main()
