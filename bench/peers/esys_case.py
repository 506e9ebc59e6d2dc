"""The peer comparison in ESyS-Particle: mpirun -np N+1 esysparticle esys_case.py N CASE STATE.csv STEPS SKIN

The same start states and steps as the decks beside it; linear springs and friction between grains. Less than the others do: there are no dashpots, walls have no
friction, and the gas is in a box with walls a radius further out. A force on a wall of ESyS-Particle is its stiffness times pi r.
"""
import csv, math, sys, time

from esys.lsm import *
from esys.lsm.util import *

workers, case, state, steps, skin = sys.argv[1:]
steps, skin, warm_up = int(steps), float(skin), 50
RADIUS, MASS = 0.002, 2700.0 * 4.0 / 3.0 * math.pi * 0.002**3

with open(state) as file:
    rows = [dict((name, float(value)) for name, value in row.items()) for row in csv.DictReader(file)]
spacing, around = 2 * RADIUS + 1.5 * skin, 4 * RADIUS
if case == "bed":
    period = 0.08 * len(rows) / 20000
    spacing = period / int(period / spacing)    # a whole number of cells
    low, high = [None, 0.0, 0.0], [None, 0.16, None]
    domain = BoundingBox(Vec3(0, -around, -around), Vec3(period, 0.16 + around, 0.2))
else:
    low, high = [-RADIUS] * 3, [max(row[c] for row in rows) + RADIUS for c in "xyz"]
    domain = BoundingBox(Vec3(*[v - around for v in low]), Vec3(*[v + around for v in high]))

sim = LsmMpi(numWorkerProcesses=int(workers), mpiDimList=[int(workers), 1, 1])
sim.initNeighbourSearch(particleType="RotSphere", gridSpacing=spacing, verletDist=0.5 * skin)
sim.setNumTimeSteps(warm_up + 3 * steps)
sim.setTimeStepSize(1.4e-5)
sim.setSpatialDomain(domain, [case == "bed", False, False])
grains = []
for i, row in enumerate(rows):
    grain = RotSphere(id=i, posn=Vec3(row["x"], row["y"], row["z"]), radius=RADIUS, mass=MASS)
    if "vx" in row:
        grain.setLinearVelocity(Vec3(row["vx"], row["vy"], row["vz"]))
    grains.append(grain)
sim.createParticles(grains)
for axis in 0, 1, 2:
    for side, place in (1, low[axis]), (-1, high[axis]):
        if place is None:
            continue
        wall = "wall%d%d" % (axis, side)
        sim.createWall(name=wall, posn=Vec3(*[place * (k == axis) for k in range(3)]), normal=Vec3(*[side * (k == axis) for k in range(3)]))
        sim.createInteractionGroup(NRotElasticWallPrms(name=wall + "_repels", wallName=wall, normalK=2400.0 / (math.pi * RADIUS)))
sim.createInteractionGroup(RotFrictionPrms(name="friction", normalK=2400.0, dynamicMu=0.3, staticMu=0.3, shearK=685.7, scaling=False, rigid=True,
                                           meanR_scaling=False))
if case == "bed":
    sim.createInteractionGroup(GravityPrms(name="gravity", acceleration=Vec3(0, 0, -9.81)))

for n in (warm_up, steps, steps, steps):
    start = time.time()
    for _ in range(n):
        sim.runTimeStep()
    print("Loop time of %.6f on %s for %d steps with %d atoms" % (time.time() - start, workers, n, len(rows)))
    sys.stdout.flush()
sim.exit()
