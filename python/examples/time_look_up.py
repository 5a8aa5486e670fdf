"""The cost of one look-up and of many from Python, and the memory of an opened dataset: see benches/bindings.sh.

    python time_look_up.py DATASET
"""

import statistics
import sys
import time
from pathlib import Path

import haptize
import numpy as np

PLACES, BLOCKS, MANY = 4096, 50, 1_000_000

field = haptize.Field.open(sys.argv[1])
least, greatest = np.array([(line[0], line[-1]) for line in field.dataset.lines]).T
random = np.random.default_rng(1)
q = random.uniform(least, greatest, (MANY, field.joints))
places, out, torque = list(q[:PLACES].copy()), np.empty(field.joints), field.torque
blocks = []
for _ in range(BLOCKS):
    begin = time.perf_counter()
    for place in places:
        torque(place, out)
    blocks.append((time.perf_counter() - begin) / PLACES * 1e9)
many = np.empty_like(q)
field.torque(q, many)
begin = time.perf_counter()
field.torque(q, many)
rate = MANY / (time.perf_counter() - begin) / 1e6
print(f"Python  {statistics.median(blocks):6.0f} ns a look-up, {rate:6.2f} million a second in a batch")

# Memory of this process [MB], where the system tells it. A field copies what it looks up; a dataset does not.
if Path("/proc/self/statm").exists():

    def resident() -> float:
        return 4096e-6 * int(Path("/proc/self/statm").read_text().split()[1])

    before = resident()
    dataset = haptize.Dataset.open(sys.argv[1])
    opened = resident() - before
    dataset.torque[0].sum()
    print(f"Python  {Path(sys.argv[1]).stat().st_size / 1e6:.0f} MB opened and checked: {opened:.1f} MB of memory, "
          f"{resident() - before:.1f} MB after a look at the torque along the first grid line")
