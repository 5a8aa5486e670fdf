"""The cost of one look-up and of many from Python: see benches/bindings.sh.

    python time_look_up.py DATASET
"""

import statistics
import sys
import time

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
