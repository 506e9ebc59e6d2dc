"""The peer comparison in Yade: yade -n -x -jTHREADS yade_case.py CASE STATE.csv STEPS SKIN [MESH.stl]

The same start states, laws, parameters and steps as the decks beside it. A bed is periodic along x alone; Yade's cell is so along all axes, and wide enough that nothing
meets across the others. Springs and dashpots of a material are twice those of a contact, as Yade has those of both bodies act in series.
"""
import csv, math, sys, time

from yade import ymport

case, state, steps, skin, *mesh = sys.argv[1:]
steps, skin, warm_up = int(steps), float(skin), 50
gravity = (0, 0, 0) if case == "gas" else (0, 0, -9.81)

if case in ("drum", "bed_hertz"):
    def material(density, young):
        return O.materials.append(FrictMat(young=young, poisson=0.3, density=density, frictionAngle=0.0))

    if case == "drum":
        small, large, steel = material(2500, 2e7), material(2000, 2e7), material(7800, 2e7)
        pairs = ((small, small, 0.6, 0.3), (small, large, 0.55, 0.4), (large, large, 0.5, 0.5), (small, steel, 0.5, 0.4), (large, steel, 0.5, 0.4))
    else:
        small = large = steel = material(2700, 5e7)
        pairs = ((steel, steel, 0.95, 0.3),)
    contact = [[Ip2_FrictMat_FrictMat_MindlinPhys(en=MatchMaker(matches=[(a, b, e) for a, b, e, _ in pairs]),
                                                  frictAngle=MatchMaker(matches=[(a, b, math.atan(mu)) for a, b, _, mu in pairs]))],
               [Law2_ScGeom_MindlinPhys_Mindlin()]]
    materials = {"small": small, "large": large}
else:
    steel = O.materials.append(ViscElMat(density=2700, kn=2 * 2400, ks=2 * 685.7, cn=2 * 0.01076, cs=2 * 0.00538, frictionAngle=math.atan(0.3)))
    contact = [[Ip2_ViscElMat_ViscElMat_ViscElPhys()], [Law2_ScGeom_ViscElPhys_Basic()]]
    materials = {}

with open(state, newline="") as file:
    for row in csv.DictReader(file):
        grain = utils.sphere([float(row[c]) for c in "xyz"], float(row["r"]), material=materials.get(row.get("material"), steel))
        if "vx" in row:
            grain.state.vel = [float(row[c]) for c in ("vx", "vy", "vz")]
            grain.state.angVel = [float(row[c]) for c in ("wx", "wy", "wz")]
        O.bodies.append(grain)
n_grains = len(O.bodies)

engines = []
if case == "gas":
    O.periodic = True
    O.cell.setBox(0.406, 0.406, 0.406)
if case.startswith("bed"):
    O.periodic = True
    O.cell.setBox(0.08 * n_grains / 20000, 0.18, 0.2)
    for axis, place in ((1, 0.0), (1, 0.16), (2, 0.0)):
        O.bodies.append(utils.wall(place, axis, material=steel))
if mesh:
    facets = O.bodies.append(ymport.stl(mesh[0], material=steel, wire=False))
    if case == "drum":
        engines = [RotationEngine(ids=facets, rotationAxis=(0, 1, 0), rotateAroundZero=True, zeroPoint=(0, 0, 0), angularVelocity=3.0)]

O.engines = [ForceResetter(),
             InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Wall_Aabb(), Bo1_Facet_Aabb()], verletDist=0.5 * skin, allowBiggerThanPeriod=True),
             InteractionLoop([Ig2_Sphere_Sphere_ScGeom(), Ig2_Wall_Sphere_ScGeom(), Ig2_Facet_Sphere_ScGeom()], *contact),
             NewtonIntegrator(gravity=gravity, damping=0), *engines]
O.dt = 1e-5 if case == "drum" else 1.4e-5
for n in (warm_up, steps, steps, steps):
    start = time.perf_counter()
    O.run(n, wait=True)
    print(f"Loop time of {time.perf_counter() - start:.6f} on threads for {n} steps with {n_grains} atoms", flush=True)
