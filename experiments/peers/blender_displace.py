# SPDX-License-Identifier: MIT
"""What Blender makes of a coarse mesh and its displacement: subdivided without smoothing, then displaced, as OFF with y up.

    blender -b -noaudio --python blender_displace.py -- MESH.glb DISPLACEMENT.exr LEVELS OUT.off
"""
import sys

import bpy
import numpy

numpy.bool = bool  # Debian's importer of Blender 3.4 asks for a name that its numpy has no longer

mesh_file, picture_file, levels, output = sys.argv[sys.argv.index("--") + 1 :]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=mesh_file)
body = next(thing for thing in bpy.data.objects if thing.type == "MESH")
body.modifiers.clear()  # the armature: the bind pose is wanted
subdivision = body.modifiers.new("subdivision", "SUBSURF")
subdivision.subdivision_type = "SIMPLE"
subdivision.levels = int(levels)
texture = bpy.data.textures.new("vectors", "IMAGE")
texture.image = bpy.data.images.load(picture_file)
texture.image.colorspace_settings.name = "Non-Color"
texture.use_clamp = False
texture.filter_size = 0.1
displacement = body.modifiers.new("displacement", "DISPLACE")
displacement.texture = texture
displacement.texture_coords = "UV"
displacement.uv_layer = body.data.uv_layers[0].name
displacement.direction = "RGB_TO_XYZ"
displacement.space = "LOCAL"
displacement.mid_level = 0
displacement.strength = 1
result = body.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
result.calc_loop_triangles()
with open(output, "w") as file:
    file.write(f"OFF\n{len(result.vertices)} {len(result.loop_triangles)} 0\n")
    for vertex in result.vertices:
        x, y, z = vertex.co
        file.write(f"{x:.9g} {z:.9g} {-y:.9g}\n")
    for triangle in result.loop_triangles:
        file.write("3 {} {} {}\n".format(*triangle.vertices))
