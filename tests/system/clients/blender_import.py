# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
"""Runs in Blender: imports FILE as its menu does, prints the contents as JSON, and renders PICTURE.

blender -b --factory-startup --python tests/system/clients/blender_import.py -- FILE PICTURE [MESH.ply]
MESH.ply: output of the modifier Volume to Mesh, for a .vdb
"""
import json
import sys

import bpy
import mathutils
import numpy

if not hasattr(numpy, "bool"):
    numpy.bool = bool  # Debian 12's Blender 3.4 imports glTF with a name absent from its NumPy

file, picture, *mesh_file = sys.argv[sys.argv.index("--") + 1 :]
bpy.ops.wm.read_factory_settings(use_empty=True)
{
    "glb": lambda: bpy.ops.import_scene.gltf(filepath=file),
    "gltf": lambda: bpy.ops.import_scene.gltf(filepath=file),
    "obj": lambda: bpy.ops.wm.obj_import(filepath=file),
    "ply": lambda: bpy.ops.import_mesh.ply(filepath=file),
    "stl": lambda: bpy.ops.import_mesh.stl(filepath=file),
    "vdb": lambda: bpy.ops.object.volume_import(filepath=file),
}[file.rsplit(".", 1)[1]]()

objects = list(bpy.context.scene.objects)
volumes = [o for o in objects if o.type == "VOLUME"]
grids = []
for volume in volumes:
    volume.data.grids.load()
    grids = sorted(grid.name for grid in volume.data.grids)
    # Modifier Volume to Mesh, on the grid tsdf at 0.
    mesh = bpy.data.objects.new("surface", bpy.data.meshes.new("surface"))
    bpy.context.collection.objects.link(mesh)
    modifier = mesh.modifiers.new("surface", "VOLUME_TO_MESH")
    modifier.object, modifier.grid_name, modifier.threshold = volume, "tsdf", 0.0
    modifier.resolution_mode = "GRID"
    evaluated = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = bpy.data.objects.new("whole", bpy.data.meshes.new_from_object(evaluated))
    bpy.context.collection.objects.link(mesh)
    objects.append(mesh)
    if mesh_file:
        m = mesh.data
        m.calc_loop_triangles()
        with open(mesh_file[0], "w") as out:
            out.write(f"ply\nformat ascii 1.0\nelement vertex {len(m.vertices)}\nproperty float x\nproperty float y\n"
                      f"property float z\nelement face {len(m.loop_triangles)}\n"
                      "property list uchar int vertex_indices\nend_header\n")
            out.writelines("{} {} {}\n".format(*v.co) for v in m.vertices)
            out.writelines("3 {} {} {}\n".format(*t.vertices) for t in m.loop_triangles)

meshes = [o for o in objects if o.type == "MESH" and len(o.data.vertices) > 0]
corners = numpy.concatenate(
    [numpy.array([o.matrix_world @ v.co for v in o.data.vertices], dtype=numpy.float64).reshape(-1, 3) for o in meshes]
)
images = {
    node.image
    for o in meshes
    for material in o.data.materials
    if material and material.use_nodes
    for node in material.node_tree.nodes
    if node.type == "TEX_IMAGE" and node.image
}
mean = None
if images:
    pixels = numpy.array(next(iter(images)).pixels[:]).reshape(-1, 4)[:, :3]
    mean = pixels.mean(axis=0).tolist()
colors = [a for o in meshes for a in o.data.color_attributes]
if colors:
    values = numpy.empty(4 * len(colors[0].data), dtype=numpy.float32)
    colors[0].data.foreach_get("color", values)
    mean = values.reshape(-1, 4)[:, :3].mean(axis=0).tolist()
print("TOLD " + json.dumps({
    "vertices": sum(len(o.data.vertices) for o in meshes),
    "triangles": sum(len(o.data.polygons) for o in meshes),
    "low": corners.min(axis=0).tolist(),
    "high": corners.max(axis=0).tolist(),
    "images": len(images),
    "mean_color": mean,
    "grids": grids,
}))

# A picture, by the CPU: from above a corner, z up.
for o in meshes:
    if o.data.color_attributes and not images:
        material = bpy.data.materials.new("colors")
        material.use_nodes = True
        attribute = material.node_tree.nodes.new("ShaderNodeVertexColor")
        attribute.layer_name = o.data.color_attributes[0].name
        shader = material.node_tree.nodes.get("Principled BSDF")
        material.node_tree.links.new(attribute.outputs["Color"], shader.inputs["Base Color"])
        o.data.materials.clear()
        o.data.materials.append(material)
middle, size = (corners.min(axis=0) + corners.max(axis=0)) / 2, numpy.linalg.norm(numpy.ptp(corners, axis=0))
scene = bpy.context.scene
eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
bpy.context.collection.objects.link(eye)
eye.location = mathutils.Vector(middle) + mathutils.Vector((0.15, -0.8, 0.35)) * size
eye.rotation_euler = (mathutils.Vector(middle) - eye.location).to_track_quat("-Z", "Y").to_euler()
scene.camera = eye
scene.world = bpy.data.worlds.new("light")
scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs[1].default_value = 2.0
scene.render.engine = "CYCLES"
scene.cycles.device, scene.cycles.samples, scene.cycles.use_denoising = "CPU", 4, False
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 480, 360, 100
scene.view_settings.view_transform = "Standard"
scene.render.filepath = picture
bpy.ops.render.render(write_still=True)
