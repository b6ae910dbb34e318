"""A motion and a map are stored, opened by another process, and reproduced from their files alone.

Prints the version that computed them, and whether both are bitwise identical.
"""

import subprocess
import sys

import stickslip as ss

AGAIN = """
import numpy as np
import stickslip as ss
import xarray as xr

motion, speeds = ss.open("stored-motion.nc"), ss.open("stored-map.zarr")
print("computed by version", xr.open_dataset("stored-motion.nc").attrs["stickslip_version"])
begun = motion.at(motion.t_span[0])
start = {x: float(begun[x]) for x in motion.final}
again = ss.simulate(motion.system, motion.t_span, initial=start, parameters=motion.parameters)
t = np.linspace(*motion.t_span, 1001)
same = all(np.array_equal(again.at(t)[x], motion.at(t)[x]) for x in motion.final)
print("motion the same:", same)
over = {name: speeds[name].values for name in speeds["speed"].dims}
found = ss.sweep(speeds.system, over, ["speed"])
print("map the same:", np.array_equal(found["speed"], speeds["speed"]))
print("certificate:", motion.certificate.ok)
"""


def store():
    toy = ss.catalogue.rocking_toy(P=1.2)
    ss.simulate(toy, (0.0, 100.0), initial={"psi": 0.8}).save("stored-motion.nc")
    ss.sweep(toy, {"P": "0.8:1.4:7"}, ["speed"], "stored-map.zarr")


if __name__ == "__main__":
    store()
    subprocess.run([sys.executable, "-c", AGAIN], check=True)
