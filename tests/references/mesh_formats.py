"""Writes the meshes of tests/object/meshes by other programs' libraries.

    pip install meshio==5.3.5 pyvista==0.49.1 trimesh==5.2.0 pycollada==0.9.3
    python tests/references/mesh_formats.py

A block of 2 x 2 x 2 cubes of 0.1 m in 48 tetrahedra, as `block` in tests/object/solid/gmsh.rs makes it, and the cube of
datasets/cube.obj as a surface.
"""

import itertools
from pathlib import Path

import meshio
import numpy as np
import pyvista
import trimesh
import vtk

HERE = Path(__file__).resolve().parents[1] / "object" / "meshes"
CUBE = Path(__file__).resolve().parents[2] / "datasets" / "cube.obj"


def block():
    """Nodes [m] and tetrahedra."""
    number = lambda at: (at[0] * 3 + at[1]) * 3 + at[2]
    nodes = 0.1 * np.array(list(itertools.product(range(3), repeat=3)), dtype=float)
    nodes[number((1, 1, 1))] += [0.02, -0.03, 0.01]
    tetrahedra = []
    for low in itertools.product(range(2), repeat=3):
        for path in [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)]:
            at, corners = list(low), [number(low)]
            for axis in path:
                at[axis] += 1
                corners.append(number(at))
            tetrahedra.append(corners)
    return nodes, np.array(tetrahedra)


def vtk_xml(name, data, mode, compressor):
    """Writes by VTK itself."""
    writer = vtk.vtkXMLUnstructuredGridWriter() if name.endswith("vtu") else vtk.vtkXMLPolyDataWriter()
    writer.SetFileName(str(HERE / name))
    writer.SetInputData(data)
    {"ascii": writer.SetDataModeToAscii, "base64": writer.SetDataModeToBinary}.get(mode, writer.SetDataModeToAppended)()
    writer.SetEncodeAppendedData(mode != "raw")
    {None: writer.SetCompressorTypeToNone, "zlib": writer.SetCompressorTypeToZLib}.get(
        compressor, writer.SetCompressorTypeToLZ4
    )()
    writer.Write()


def main():
    HERE.mkdir(exist_ok=True)
    nodes, tetrahedra = block()
    region = np.where(nodes[tetrahedra].mean(1)[:, 2] > 0.1, 2, 1).astype(np.int32)
    mesh = meshio.Mesh(
        nodes,
        [("tetra", tetrahedra)],
        cell_data={"gmsh:physical": [region], "gmsh:geometrical": [region]},
    )
    meshio.gmsh.write(HERE / "binary_4.msh", mesh, "4.1", binary=True)
    meshio.gmsh.write(HERE / "binary_2.msh", mesh, "2.2", binary=True)
    # TetGen's nodes count from 0, or from 1; MEDIT's from 1.
    meshio.tetgen.write(HERE / "block.node", meshio.Mesh(nodes, [("tetra", tetrahedra)], cell_data={"tetgen:ref": [region]}))
    meshio.medit.write(HERE / "block.mesh", meshio.Mesh(nodes, [("tetra", tetrahedra)], cell_data={"medit:ref": [region]}))
    grid = pyvista.UnstructuredGrid({vtk.VTK_TETRA: tetrahedra}, nodes)
    grid.save(HERE / "binary_5.vtk", binary=True)
    meshio.vtk.write(HERE / "text_4.vtk", meshio.Mesh(nodes, [("tetra", tetrahedra)]), fmt_version="4.2", binary=False)
    vtk_xml("text.vtu", grid, "ascii", None)
    vtk_xml("base64_zlib.vtu", grid, "base64", "zlib")
    vtk_xml("raw_lz4.vtu", grid, "raw", "lz4")
    vtk_xml("appended.vtu", grid, "appended", None)
    cube = trimesh.load(CUBE, process=False)
    # glTF's y is up.
    up = trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0])
    scene = trimesh.Scene()
    half = cube.copy()
    half.apply_translation([-0.25, 0, 0])
    scene.add_geometry(half, transform=up @ trimesh.transformations.translation_matrix([0.25, 0, 0]))
    scene.export(HERE / "cube.glb")
    cube.export(HERE / "cube.dae")
    surface = pyvista.wrap(cube)
    surface.save(HERE / "cube.vtk", binary=True)
    vtk_xml("cube.vtp", surface, "appended", "zlib")


main()
