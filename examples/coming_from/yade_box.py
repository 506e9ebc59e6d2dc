from yade import export, pack
glass = O.materials.append(ViscElMat(density=2500, kn=10000, ks=2857.2, cn=0.06136, cs=0.03068, frictionAngle=atan(0.4)))
for axis in 0, 1, 2:
    for place in 0, (0.05, 0.05, 0.1)[axis]:
        O.bodies.append(utils.wall(place, axis, material=glass))
grains = pack.SpherePack()
grains.makeCloud((0, 0, 0), (0.05, 0.05, 0.1), rMean=0.002, num=1865)
grains.toSimulation(material=glass)
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Wall_Aabb()]),
    InteractionLoop([Ig2_Sphere_Sphere_ScGeom(), Ig2_Wall_Sphere_ScGeom()],
                    [Ip2_ViscElMat_ViscElMat_ViscElPhys()], [Law2_ScGeom_ViscElPhys_Basic()]),
    NewtonIntegrator(gravity=(0, 0, -9.81), damping=0),
    PyRunner(command="export.text('grains_%d.txt' % O.iter)", iterPeriod=5000)]
O.dt = 1e-5
O.run(30001, wait=True)
