from random import random, seed
from esys.lsm import *
from esys.lsm.util import *
size, radius, count = (0.05, 0.05, 0.1), 0.002, 1865
sim = LsmMpi(numWorkerProcesses=1, mpiDimList=[1, 1, 1])
sim.initNeighbourSearch(particleType="RotSphere", gridSpacing=0.011, verletDist=0.0004)
sim.setNumTimeSteps(30000)
sim.setTimeStepSize(1e-5)
sim.setSpatialDomain(BoundingBox(Vec3(-0.01, -0.01, -0.01), Vec3(0.06, 0.06, 0.11)))
seed(1)
places = []
while len(places) < count:
    p = [radius + random() * (length - 2 * radius) for length in size]
    if all((p[0] - q[0])**2 + (p[1] - q[1])**2 + (p[2] - q[2])**2 >= 4 * radius**2 for q in places):
        sim.createParticle(RotSphere(id=len(places), posn=Vec3(*p), radius=radius, mass=2500 * 4 / 3 * 3.14159265 * radius**3))
        places.append(p)
for axis in 0, 1, 2:
    for side, place in (1, 0), (-1, size[axis]):
        wall = "wall%d%d" % (axis, side)
        sim.createWall(name=wall, posn=Vec3(*[place * (k == axis) for k in range(3)]),
                       normal=Vec3(*[side * (k == axis) for k in range(3)]))
        sim.createInteractionGroup(NRotElasticWallPrms(name=wall + "_repels", wallName=wall, normalK=5000 / (3.14159265 * radius)))
sim.createInteractionGroup(RotFrictionPrms(name="friction", normalK=5000.0, dynamicMu=0.4, staticMu=0.4, shearK=1428.6,
                                           scaling=False, rigid=True, meanR_scaling=False))
sim.createInteractionGroup(GravityPrms(name="gravity", acceleration=Vec3(0, 0, -9.81)))
sim.createInteractionGroup(LinDampingPrms(name="damping", viscosity=20.0, maxIterations=50))
sim.createInteractionGroup(RotDampingPrms(name="turning", viscosity=20.0, maxIterations=50))
sim.createCheckPointer(CheckPointPrms(fileNamePrefix="grains", beginTimeStep=0, endTimeStep=30000, timeStepIncr=5000))
sim.run()
