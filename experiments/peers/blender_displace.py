# SPDX-License-Identifier: MIT
"""What Blender makes of a coarse mesh and its displacement: subdivided without smoothing, then displaced, as OFF with y up.

    blender -b -noaudio --python blender_displace.py -- MESH.glb DISPLACEMENT.exr LEVELS object|tangent OUT.off

object: by a Displace modifier. tangent: by the normals, tangents and signs that Blender gives the subdivided mesh, which
its shaders use as well.
"""
import sys

import bpy
import numpy

numpy.bool = bool  # Debian's importer of Blender 3.4 asks for a name that its numpy has no longer


def displace_by_modifier(body, image):
    """Adds a modifier that moves the vertices by an image of vectors in object space."""
    texture = bpy.data.textures.new("vectors", "IMAGE")
    texture.image = image
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


def of_loops(collection, name, width, kind=numpy.float32):
    """An attribute of all elements of a collection, a row each."""
    values = numpy.empty(len(collection) * width, kind)
    collection.foreach_get(name, values)
    return values.reshape(-1, width)


def read_linear(image, uv):
    """The image's first three channels between its pixels; rows from below, as Blender has them."""
    width, height = image.size
    pixels = numpy.empty(width * height * image.channels, numpy.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, image.channels)[:, :, :3]
    place = uv * (width, height) - 0.5
    low = numpy.floor(place).astype(int)
    share = place - low
    result = 0
    for dx in (0, 1):
        for dy in (0, 1):
            weight = numpy.abs(1 - dx - share[:, 0]) * numpy.abs(1 - dy - share[:, 1])
            x, y = (low[:, 0] + dx).clip(0, width - 1), (low[:, 1] + dy).clip(0, height - 1)
            result = result + weight[:, None] * pixels[y, x]
    return result


def displace_by_tangents(mesh, image):
    """Moves the vertices by an image of vectors along tangent, normal and bitangent. A vertex on a seam of the texture
    goes where the first of its corners says."""
    mesh.calc_tangents()
    vertices = of_loops(mesh.loops, "vertex_index", 1, numpy.int32)[:, 0]
    tangent, normal = of_loops(mesh.loops, "tangent", 3), of_loops(mesh.loops, "normal", 3)
    bitangent = of_loops(mesh.loops, "bitangent_sign", 1) * numpy.cross(normal, tangent)
    vectors = read_linear(image, of_loops(mesh.uv_layers[0].data, "uv", 2))
    moves = vectors[:, :1] * tangent + vectors[:, 1:2] * normal + vectors[:, 2:] * bitangent
    used, first = numpy.unique(vertices, return_index=True)
    positions = of_loops(mesh.vertices, "co", 3)
    positions[used] += moves[first]
    mesh.vertices.foreach_set("co", positions.ravel())


mesh_file, picture_file, levels, space, output = sys.argv[sys.argv.index("--") + 1 :]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=mesh_file)
body = next(thing for thing in bpy.data.objects if thing.type == "MESH")
body.modifiers.clear()  # the armature: the bind pose is wanted
subdivision = body.modifiers.new("subdivision", "SUBSURF")
subdivision.subdivision_type = "SIMPLE"
subdivision.use_custom_normals = True
subdivision.levels = int(levels)
vectors = bpy.data.images.load(picture_file)
vectors.colorspace_settings.name = "Non-Color"
if space == "object":
    displace_by_modifier(body, vectors)
result = body.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
if space == "tangent":
    displace_by_tangents(result, vectors)
result.calc_loop_triangles()
with open(output, "w") as file:
    file.write(f"OFF\n{len(result.vertices)} {len(result.loop_triangles)} 0\n")
    for vertex in result.vertices:
        x, y, z = vertex.co
        file.write(f"{x:.9g} {z:.9g} {-y:.9g}\n")
    for triangle in result.loop_triangles:
        file.write("3 {} {} {}\n".format(*triangle.vertices))
