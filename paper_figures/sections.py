# SPDX-License-Identifier: MIT
"""The sections of the page, in the paper's order, and of the page for a model of one's own."""
import fig14_fidelity
import fig19_limits
import pictures
import scale
import schematics
import sweeps
import table1_times
from blocks import Section


def _figures(*numbers):
    return tuple(f"fig-{number}" for number in numbers)


SCHEME = "A scheme, drawn from the formulas that the program uses."

PAPER = [
    Section("pipeline", "The pipeline", pictures.pipeline, "Figure 1", _figures(1), (),
            paper="One model on its way: mesh and skeleton, the space around the bones divided, the normalized tangent space, the texture, and the model that comes back.",
            here="The same steps on one of the standard models.",
            differs="Our texture has no blank texels, and seams are data of their own beside it."),
    Section("view", "Two models to try", pictures.viewer, "", (), ("view",),
            here="The page of skeletex view: turn it, drag a joint, morph it to the second model, click bones to transfer them. The browser reconstructs the surface from the texture."),
    Section("planes", "Separation planes", schematics.figure2, "Figure 2", _figures(2),
            paper="The plane between two bones of a node, and all planes of one bone between a linear and a branch node.",
            here=SCHEME + " A point belongs to the bone whose direction away from the node has the largest dot product with the vector from the node to the point.",
            differs="None in the planes. All cells at a node are found at once by that dot product, which also settles points on a plane the same way for both sides."),
    Section("cut", "How a segment is cut out", lambda results: schematics.figure3(results) + pictures.cuts(results), "Figure 3", _figures(3),
            paper="The planes cut the mesh, new vertices mark the boundary, and a flood fill collects the segment.",
            here="A scheme in the plane, and the cut mesh of standard models: the edges that run along the borders of the colours are new.",
            differs="The paper cuts with whole planes and then filters. We clip triangles that straddle a cell, and keep the cross-section that is around the node."),
    Section("segments", "Segments, layout, texture", pictures.segments, "Figures 4 and 11", _figures(4, 11), ("segments",),
            paper="Coloured segments of a set of models, and the rectangles of the segments in a texture.",
            here="Segments of the standard models, each bone with a colour of its own, and layout and texture of two of them: red, green and blue are the displacements along, around and away from the bone.",
            differs="The models are others: those that Debian distributes. Rectangles get their share by the expected error, not by the length of bones, and fill the texture."),
    Section("spd", "The map by separation planes (SPD)", schematics.figure5, "Figure 5", _figures(5),
            paper="u of a point by the line through it that is parallel to the bone; v by the angle around the bone.",
            here=SCHEME + " All points with the same (u, v) lie on one ray, so SPD is a ray caster, and its texture a height field.",
            differs="The same map. We find its texels by casting rays, and say how much of the surface no ray sees."),
    Section("methods", "SPD, VSM and hybrid", pictures.methods, "Figure 6", _figures(6), ("methods",),
            paper="A hand and a head by both maps, and a body that uses VSM for the hands and SPD elsewhere.",
            here="The whole model by the three methods, and below it a checker on (u, v).",
            differs="Hybrid decides bone by bone by the distances that it measures; the paper leaves the choice to the user.",
            remark="The bunny: SPD loses what the rays from the bone do not see, such as the inside of the ears. VSM keeps all of the surface and stretches the checker. Hybrid takes SPD only where it sees enough, here nowhere."),
    Section("tangent-space", "Bone tangent space", pictures.tangent_space, "Figure 7", _figures(7), ("tangent_space",),
            paper="A constant plane of the tangent space, in two poses.",
            here="All texels (0, 0, 0.03 diagonals), by the paper's deformation rule, in the bind pose and three others: tubes of one radius around the bones.",
            differs="None that we know of. The tubes meet in mitres, as the frames lean with the separation planes."),
    Section("intervals", "Rays, intervals and the turn of columns", schematics.figure8, "Figure 8", _figures(8),
            paper="Two rays where the separation planes of a node meet, the intervals between them, and the angles by which columns turn in a pose.",
            here=SCHEME + " The bone is seen along its axis. With three bones at a node the two rays are opposite, so both intervals are one half in every pose and all columns turn alike. With four bones the intervals change.",
            differs="The paper draws three bones. With four, an interval can get a negative length; we wrap the difference to the bind pose, which the formula of the paper does not say."),
    Section("lattice", "From lattice to surface", pictures.lattice, "Figure 9", _figures(9), ("lattice",),
            paper="The grid with a vertex for each texel, a constant displacement, the surface.",
            here="96 x 96 texels: the layout, all texels (0, 0, 0.02 diagonals), the model.",
            differs="Our lattices end on shared vertices at seams, corners and poles, so the mesh is closed by its indices. The paper places two rows there."),
    Section("distance", "Restoring the distance to the bones", pictures.distance, "Figure 10", _figures(10), ("distance",),
            paper="A limb gets thin where it bends, unless the distance of each point to the bone is stored and restored.",
            here="The man with one knee bent by 110 degrees, by the paper's rule and SPD, without and with the distances restored, and the distance between both surfaces.",
            differs="The formula: we use the component perpendicular to the bone. Taken by the letter, the paper's dot product with s' is off by more than 1 % where vectors lean sideways."),
    Section("cyclic", "Skeletons with cycles", pictures.cyclic, "Figure 12", _figures(12), ("cyclic",),
            paper="One geometry with several skeletons that have cycles.",
            here="One body with two handles, and three skeletons for it. Genus and closedness are measured on the reconstruction.",
            differs="The body is another. The paper's text defines a tree; here a skeleton is a graph."),
    Section("detail", "Levels of detail", pictures.detail, "Figure 13", _figures(13), ("detail",),
            paper="The bust of Einstein from 32 to 1024 texels: a head can be recognized at 32, its face from 128 on, and 1024 shows no artefacts.",
            here="Six sizes, all read from one model of 1024 x 1024 texels, with a normal per triangle.",
            differs="Another model: the bust is not among the meshes that Debian distributes. Every level is closed, as seams are kept at all sizes."),
    Section("fidelity", "Error against texture size", fig14_fidelity.make, "Figure 14", _figures(14), ("fidelity",),
            paper="Mean and standard deviation of the metro distance of the vertices, per model, over the texture size. The gain is large up to 512 x 512, which the paper uses from there on.",
            here="The same for each method, and the distance of the two surfaces below it. The distances of vertices say little about the surface between them once texels lie on the vertices themselves.",
            differs="The paper's text has no number for this figure. We read texels at vertices and edges of the mesh where there are enough, so our error goes on falling beyond 512, and faster than that of a regular grid.",
            remark="VSM and hybrid fall together where hybrid chooses VSM for all bones. SPD stays where the parts that its rays miss are."),
    Section("size", "Which size do I need?", fig14_fidelity.which_size, "", (), (),
            here="For five uses, the smallest size from which on the reconstruction is good enough, by the default method; then what each size costs. For a model of your own: scripts/reproduce.sh MESH SKELETON."),
    Section("results", "Input, reconstruction, error, layout, texture", pictures.overview, "Figure 15", _figures(15), ("results",),
            paper="For each model the skeleton, the layout and the texture, the reconstruction, and the distance to the original in colours.",
            here="The same at 512 x 512. Each picture of the error has a scale of its own.",
            differs="Other models. Blank patches, which the paper names as a cost, do not occur."),
    Section("morph", "Morph sequences", pictures.morph, "Figure 16", _figures(16), ("morph",),
            paper="A human becomes a ninja turtle; texels and skeletons are interpolated linearly, by SPD.",
            here="Three pairs. Bones are matched by the graphs of the skeletons alone. Every frame is measured.",
            differs="Other models. After the linear means we turn edges to the mean orientation of both surfaces, which takes away creases at seams.",
            remark="Nothing but the skeleton tells what belongs together: half-way from man to homer, the faces do not meet, as the map around the head's bone does not know of mouths."),
    Section("blending", "Blending near a seam", schematics.figure17, "Figure 17", _figures(17),
            paper="A function of the distance to the patch's boundary mixes the displacements of both models; the cosine is used for the results.",
            here=SCHEME + " Left the three functions to choose from, right what they do to a profile.",
            differs="The paper mixes texels of both models. We keep the part's shape and add a correction that fades: what is missing in height and slope at the seam. Short waves around the bone fade sooner than long ones."),
    Section("transfer", "Transfer of surface regions", pictures.transfer, "Figures 18 and 19", _figures(18), ("transfer",),
            paper="The bunny gets horns for ears, and the armadillo a pincer for a paw, by cosine blending.",
            here="Bones or limbs of one model on another, without and with blending, and a limb replaced by the mirror image of the model's own other one.",
            differs="The bunny gets horns too; the crab, from which the pincer came, is not among our models, so the armadillo gets an arm of the man. Without blending the whole patch is the source's and the seam shows."),
    Section("limits", "What cannot be segmented", fig19_limits.make, "Figure 19, left", _figures(19), ("limits",),
            paper="Two planes of a bone cross inside the body, and the surface behind their crossing is missing from the model. A second case has neighbours on the surface that are none in the skeleton.",
            here="The bear with a skeleton whose neck is too short for the width of the body.",
            differs="The skeleton is refused, with the place and a remedy; the paper leaves the model incomplete. validate --repair proposes a skeleton that works."),
    Section("morph-methods", "Morphing by SPD and by VSM", pictures.morph_methods, "Figure 19, middle", (), ("morph_methods",),
            paper="Half-way between two models, VSM shifts the surface sideways; SPD gives the better mean.",
            here="Half-way between two animals by either map, and the distortion of the map between both.",
            differs="The paper's finding does not hold for every pair. VSM keeps all of both surfaces and distorts what one of them lacks; SPD leaves out what its rays do not see, and tears there."),
    Section("seam", "A transfer without and with blending", pictures.transfer_seam, "Figure 19, right", (), (),
            paper="Without interpolation a line shows at the seam; with it, details at the seam are lost.",
            here="One of the transfers above.",
            differs="The correction keeps the details of the part, as it changes long waves more than short ones."),
    Section("animation", "Animation, and bones turned too far", pictures.animation, "Figure 20", _figures(20), ("animation",),
            paper="An animated model, and a pose in which the bones turn so far that it looks unnatural.",
            here="Poses between key frames, and one that turns bones by 80 to 120 degrees. All are closed.",
            differs="The surface is posed smoothly, by blended dual quaternions whose weights have a closed form. The paper's own rule, which bends sharply at every separation plane, is in Figure 10 and in the comparison with skinning below."),
    Section("times", "Preprocessing times", table1_times.times, "Table 1", ("table-1",), ("times", "times_decimated"),
            paper="Times of the half-edge mesh, of the segmentation and of the parameterization for six models at 512 x 512, on a machine that it does not name.",
            here="The same stages, measured inside the program, and the encoding of texels, which the paper does not tell. Copies have the paper's numbers of vertices.",
            differs="Machines and models differ, so factors say little. The paper's conversion to half edges by OpenMesh takes seconds, ours milliseconds; its parameterization is the part that is closest to ours."),
    Section("frames", "Frames per second", table1_times.frames, "Section 4", ("section-4",), ("frames",),
            paper="Some 90 frames per second at 2048 x 2048, drawn, on a GeForce GTX 1080.",
            here="A frame ends with all vertices on the OpenCL device and is not drawn. A morph makes its texels anew for every frame.",
            differs="Another device; see the record. A copy of as many bytes on the device is the yardstick: no frame can be faster."),
    Section("topology", "Closed at every size, without blank texels", pictures.topology, "Section 6", ("section-6",), ("topology",),
            paper="Says that its textures have blank patches and float texels, at the cost of memory.",
            here="Every model, method and size of the experiment, checked for holes, edges of more than two triangles, orientation, pieces and genus."),
    Section("posing", "Beyond the paper: poses beside skinning", sweeps.posing, "", (), ("posing",),
            here="New folds (edges that bend beyond 90 degrees) and new intersecting pairs of triangles, summed over the poses of configs/poses/evaluation, by each rule of this program and by skinning with each "
                 "vertex' own bone diffused over 0.05 of the diagonal (narrow: 0.025)."),
    Section("skinning", "Beyond the paper: poses beside dual quaternion skinning", pictures.skinning, "", (), ("skinning",),
            here="The bear has 60 degrees at every joint below its root, the man sits, the armadillo has an elbow and a knee bent by 90 degrees; 256 x 256 texels.",
            remark="The smooth rule makes fewer new folds than dual quaternion skinning. It looks worse at the root of the sitting man's left thigh, where it leaves a blunt step, and at the bear's ear, which "
                   "it stretches. Polishing takes away single folds and leaves the form. The paper's rule crumples the surface at the separation planes."),
    Section("reach", "Beyond the paper: how far a joint reaches", pictures.reach, "", (), ("reach",),
            here="Weights of the bone that turns, from 0 (dark) to 1 (bright); the bones beyond it go along as a whole.",
            remark="The man's upper arm moves the arm and its shoulder alone. A joint in the middle of a wide trunk reaches as far as the trunk is wide: the thighs of the camel and the cow take part of the other "
                   "thigh along, and the armadillo's neck its chest, shell and upper arms."),
    Section("landmarks", "Beyond the paper: landmarks", pictures.landmarks, "", (), ("landmarks",),
            here="Half-way from man to homer at 512 x 512 texels. Nine points on each face are to meet; the map of the head bends smoothly so that they do, and stays one-to-one.",
            remark="With landmarks there is one mouth and one nose. They cost some distortion of the map."),
    Section("iterations", "Beyond the paper: iterations of VSM", sweeps.iterations, "", (), ("iterations",),
            here="The paper's weights w A even out areas in the texture; divided by a power of the surface area they even out the texels on the surface. Zero iterations are the barycentric map with equal weights."),
    Section("recipe", "Beyond the paper: its recipe, and each change alone", sweeps.recipe, "", (), ("recipe",),
            here="The recipe of the paper as far as it can be chosen (--paper-recipe), the default, and a regular grid with one change at a time."),
    Section("simplification", "Beyond the paper: beside simplification and remeshing", sweeps.simplification, "", (), ("simplification",),
            here="As many vertices by each way. A texture is better than a uniform remesh. A simplification puts its vertices where the surface bends, which a lattice can where it has texels enough."),
    Section("bytes", "Beyond the paper: error against bytes", sweeps.file_sizes, "", (), ("bytes", "draco"),
            here="Half floats are those near the texels whose points stay nearest to the surface, or the nearest ones. Draco codes the input mesh alone and needs far fewer bytes. The texture pays for being "
                 "editable: every texel is a displacement that can be posed, morphed and filtered."),
    Section("scale", "Beyond the paper: time and memory against the number of triangles", scale.make, "", (), ("scale",),
            here="encode as a whole command, files included, at 512 x 512, regular grid: the armadillo remeshed or decimated, and subdivided. The dotted line is n log n through the fewest triangles beyond 100,000."),
]

_BY_NAME = {section.anchor: section for section in PAPER}


def _own(anchor, here=None, title=None):
    section = _BY_NAME[anchor]
    experiments = tuple(name for name in section.experiments if name != "times_decimated")
    return Section(anchor, title or section.title, section.make, section.figures, (), experiments, here=here or section.here)


OWN = [
    _own("size", "For five uses, the smallest size from which on the reconstruction is good enough, by the default method; then what each size costs. A size that is not in the table can be tried with "
                 "skeletex encode MESH SKELETON --size N, and measured with skeletex metro."),
    _own("results", "At 512 x 512: the input with its skeleton, the reconstruction, the distance of the original's vertices in colours, the layout and the texture."),
    _own("fidelity"),
    _own("segments", "Each bone has a colour of its own. A piece of a colour in the wrong place tells that a node should move. Red, green and blue of the texture are the displacements along, around and away "
                     "from the bone."),
    _own("methods", "The model by the three methods, and below it a checker on (u, v). SPD is a height field over the bone and leaves out what its rays do not see; VSM keeps all of the surface; hybrid takes "
                    "for each bone the better one."),
    _own("detail"),
    _own("times", "Each stage, measured inside the program."),
]
