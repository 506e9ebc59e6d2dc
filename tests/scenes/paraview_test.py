"""ParaView itself opens a run: snapshots.xdmf and the .pvd of an export. Run by pvpython; see pictures_test.py for the rest.

usage: pvpython paraview_test.py RUN EXPORT      (prints what it finds as JSON)
"""

import json
import sys

from paraview import simple, servermanager
from vtkmodules.util.numpy_support import vtk_to_numpy


def blocks(data):
    """The data sets in a tree of them."""
    if not hasattr(data, "GetNumberOfBlocks"):
        return [data]
    return [leaf for k in range(data.GetNumberOfBlocks()) if data.GetBlock(k) for leaf in blocks(data.GetBlock(k))]


def describe(reader, times):
    frames = []
    for time in times:
        reader.UpdatePipeline(time)
        found = {"time": time}
        for leaf in blocks(servermanager.Fetch(reader)):
            point, cell = leaf.GetPointData(), leaf.GetCellData()
            arrays = {a.GetArrayName(k): a.GetArray(k) for a in (point, cell) for k in range(a.GetNumberOfArrays())}
            if "radius" in arrays:
                found.update(grains=leaf.GetNumberOfPoints(), radii=float(vtk_to_numpy(arrays["radius"]).sum()),
                             heights=float(sum(leaf.GetPoint(i)[2] for i in range(leaf.GetNumberOfPoints()))), fields=sorted(arrays))
            elif "void_fraction" in arrays:
                found.update(cells=leaf.GetNumberOfCells(), void=float(vtk_to_numpy(arrays["void_fraction"]).sum()))
        frames.append(found)
    return frames


results = {}
for name, file in (("xdmf", sys.argv[1] + "/snapshots.xdmf"), ("pvd", sys.argv[2] + "/grains.pvd")):
    source = simple.OpenDataFile(file) if name == "pvd" else simple.XDMFReader(FileNames=[file])
    results[name] = describe(source, list(source.TimestepValues))
print("RESULT " + json.dumps(results))
