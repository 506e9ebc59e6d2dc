"""ParaView itself opens series of runs and exports. Run by pvpython; see pictures_test.py for the rest.

usage: pvpython paraview_test.py FILE...      (.xdmf or .pvd; prints what it finds as JSON)

Of each file: for each time the data sets in it, each with its numbers of points and cells, and for each array of these the components and the
sum of all values.
"""

import json
import sys

from paraview import simple, servermanager
from vtkmodules.util.numpy_support import vtk_to_numpy


def leaves(data):
    """The data sets in a tree of them."""
    if not hasattr(data, "GetNumberOfBlocks"):
        return [data]
    return [leaf for k in range(data.GetNumberOfBlocks()) if data.GetBlock(k) for leaf in leaves(data.GetBlock(k))]


def arrays(data):
    found = {}
    for k in range(data.GetNumberOfArrays()):
        values = vtk_to_numpy(data.GetArray(k))
        found[data.GetArrayName(k)] = [1 if values.ndim == 1 else values.shape[1], float(values.astype(float).sum())]
    return found


def describe(leaf):
    return {"points": leaf.GetNumberOfPoints(), "cells": leaf.GetNumberOfCells(), "of points": arrays(leaf.GetPointData()),
            "of cells": arrays(leaf.GetCellData()),
            "heights": sum(leaf.GetPoint(i)[2] for i in range(leaf.GetNumberOfPoints())) if leaf.GetNumberOfPoints() < 1e5 else None}


results = {}
for file in sys.argv[1:]:
    source = simple.XDMFReader(FileNames=[file]) if file.endswith(".xdmf") else simple.OpenDataFile(file)
    results[file] = []
    for time in source.TimestepValues:
        source.UpdatePipeline(time)
        results[file].append({"time": time, "sets": [describe(leaf) for leaf in leaves(servermanager.Fetch(source))]})
    simple.Delete(source)
print("RESULT " + json.dumps(results))
