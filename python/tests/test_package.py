# SPDX-License-Identifier: MIT
"""The package on real models: arrays, the same bytes as the program's, edits of textures, errors, threads, pictures."""

from __future__ import annotations

import html
import inspect
import json
import os
import re
import shutil
import signal
import subprocess
import threading
import time
from pathlib import Path
from typing import Any, Callable

import numpy as np
import pytest

import skeletex
from conftest import ROOT

TETRAHEDRON = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


# Arrays


@pytest.mark.parametrize("dtype", ["float32", "float64", ">f8", "int64", "uint8"])
@pytest.mark.parametrize("arrange", [np.ascontiguousarray, np.asfortranarray, lambda a: np.repeat(a, 2, axis=0)[::2]])
def test_a_mesh_takes_arrays_of_any_type_and_order_and_owns_them(dtype: str, arrange: Callable[[Any], Any]) -> None:
    vertices = arrange(np.array(TETRAHEDRON[0], dtype=dtype))
    triangles = arrange(np.array(TETRAHEDRON[1], dtype=dtype))
    mesh = skeletex.Mesh(vertices, triangles)
    expected = skeletex.Mesh(*TETRAHEDRON)
    vertices[...] = 7
    triangles[...] = 0
    assert np.array_equal(mesh.vertices, expected.vertices) and mesh.vertices.dtype == np.float64
    assert np.array_equal(mesh.triangles, expected.triangles) and mesh.triangles.dtype == np.int32
    assert mesh.topology() == {
        "vertices": 4, "edges": 6, "triangles": 4, "components": 1, "genus": 0, "is_closed_manifold": True
    }  # fmt: skip


@pytest.mark.parametrize(
    "vertices, triangles, message",
    [
        ([[0, 0]], [[0, 0, 0]], r"vertices: .*\(n, 3\)"),
        ([["a", "b", "c"]], [[0, 0, 0]], "vertices: .*real numbers"),
        ([[1j, 0, 0]], [[0, 0, 0]], "vertices: .*real numbers"),
        ([[0, 0, 0], [0, 0]], [[0, 0, 0]], "vertices: .*real numbers"),
        ([[0, 0, 0]], [[0, 0.5, 0]], "triangles: .*whole numbers"),
        ([[0, 0, 0]], [[0, 0, 2**33]], "triangles: .*whole numbers"),
    ],
)
def test_arrays_that_are_no_mesh_are_refused(vertices: Any, triangles: Any, message: str) -> None:
    with pytest.raises(skeletex.InputError, match=message):
        skeletex.Mesh(vertices, triangles)


def test_indices_that_do_not_exist_are_refused_where_they_would_be_read(tmp_path: Path) -> None:
    mesh = skeletex.Mesh(TETRAHEDRON[0], [[0, 1, 4]])
    for use in (
        lambda: skeletex.render(mesh),
        lambda: mesh.write(tmp_path / "mesh.ply"),
        lambda: skeletex.metro(mesh, mesh),
        lambda: skeletex.deformation(mesh, mesh),
        lambda: skeletex.render(skeletex.Mesh(*TETRAHEDRON), skeleton=skeletex.Skeleton([[0, 0, 0]], [[0, 7]])),
    ):
        with pytest.raises(skeletex.InputError):
            use()
    assert not list(tmp_path.iterdir())


def test_files_of_meshes_and_skeletons_come_back(
    tmp_path: Path, bear_mesh: skeletex.Mesh, bear_skeleton: skeletex.Skeleton
) -> None:
    bear_mesh.write(tmp_path / "bear.ply")
    again = skeletex.Mesh.read(tmp_path / "bear.ply")
    assert np.array_equal(again.triangles, bear_mesh.triangles)
    assert np.abs(again.vertices - bear_mesh.vertices).max() < 1e-6 * bear_mesh.diagonal
    bear_skeleton.write(tmp_path / "bear.json")
    other = skeletex.Skeleton.read(tmp_path / "bear.json")
    assert np.array_equal(other.nodes, bear_skeleton.nodes) and np.array_equal(other.bones, bear_skeleton.bones)
    assert other.node_names == bear_skeleton.node_names and other.bone_names == bear_skeleton.bone_names
    assert np.array_equal(other.s, bear_skeleton.s, equal_nan=True)


# The program's results


def run(program: str, *arguments: Any) -> None:
    subprocess.run([program, *map(str, arguments)], check=True, capture_output=True)


def test_results_are_the_program_s_byte_by_byte(
    tmp_path: Path, program: str, bear: skeletex.Model, bear_bis: skeletex.Model
) -> None:
    mesh, skeleton = ROOT / "build/meshes/bear.off", ROOT / "configs/skeletons/bear.skeleton.json"
    a, b = tmp_path / "a.skx.exr", tmp_path / "b.skx.exr"
    run(program, "encode", mesh, skeleton, "-o", a, "--size", 128)
    bear.write(tmp_path / "own.skx.exr")
    assert (tmp_path / "own.skx.exr").read_bytes() == a.read_bytes()
    bear_bis.write(b)
    bear, bear_bis = skeletex.Model.read(a), skeletex.Model.read(b)  # files hold normals in half precision
    for name, own, command in [
        ("half", lambda: skeletex.lod(bear, 64), ["lod", a, "--size", 64]),
        ("smooth", lambda: skeletex.smooth(bear, scale=0.02, keep_volume=True, bones=["head"]),
         ["filter", a, "smooth", "--scale", 0.02, "--keep-volume", "--bones", "head"]),
        ("sharp", lambda: skeletex.enhance(bear, gain=2), ["filter", a, "enhance", "--gain", 2]),
        ("noise", lambda: skeletex.add_noise(bear, seed=3), ["filter", a, "noise", "--seed", 3]),
        ("morph", lambda: skeletex.morph([bear, bear_bis], 0.25), ["morph", a, b, "--t", 0.25]),
        ("transfer", lambda: skeletex.transfer(bear_bis, bear, {"left_ear": "left_ear"}, scale="girth"),
         ["transfer", b, a, "--bones", "left_ear=left_ear", "--scale", "girth"]),
        ("paper", lambda: skeletex.encode(skeletex.Mesh.read(mesh), skeletex.Skeleton.read(skeleton), size=(96, 64),
                                          method="hybrid", bone_methods={"head": "vsm"}, paper_recipe=True),
         ["encode", mesh, skeleton, "--size", "96x64", "--method", "hybrid", "--bone-method", "head=vsm",
          "--paper-recipe"]),
    ]:  # fmt: skip
        run(program, *command, "-o", tmp_path / f"{name}.skx.exr")
        own().write(tmp_path / f"{name}_own.skx.exr")
        assert (tmp_path / f"{name}_own.skx.exr").read_bytes() == (tmp_path / f"{name}.skx.exr").read_bytes(), name


def test_poses_are_the_program_s(tmp_path: Path, program: str, bear: skeletex.Model) -> None:
    bear.write(tmp_path / "bear.skx.exr")
    pose = ROOT / "configs/poses/bear_wave.json"
    for rule in ("smooth", "paper", "linear"):
        run(program, "reconstruct", tmp_path / "bear.skx.exr", "--pose", pose, "--deform", rule, "--no-report",
            "--all-texels", "-o", tmp_path / "pose.ply")  # fmt: skip
        skeletex.reconstruct(bear, pose, deform=rule).write(tmp_path / "own.ply")
        own, theirs = (skeletex.Mesh.read(tmp_path / name) for name in ("own.ply", "pose.ply"))
        assert np.array_equal(own.vertices, theirs.vertices) and np.array_equal(own.triangles, theirs.triangles), rule


def test_thin_triangles_are_left_out_as_by_the_program(tmp_path: Path, program: str, bear: skeletex.Model) -> None:
    bear.write(tmp_path / "bear.skx.exr")
    run(program, "reconstruct", tmp_path / "bear.skx.exr", "-o", tmp_path / "bear.ply")
    theirs, mesh = skeletex.Mesh.read(tmp_path / "bear.ply"), skeletex.reconstruct(bear)
    own, vertices = skeletex.without_thin_triangles(mesh)
    assert np.array_equal(own.vertices, mesh.vertices[vertices])
    assert len(own.vertices) < 0.99 * len(mesh.vertices)
    assert abs(len(own.vertices) - len(theirs.vertices)) <= 0.001 * len(mesh.vertices)  # chosen in another frame


# Models


def test_a_model_reconstructs_to_a_closed_mesh_near_the_input_at_every_size(
    bear: skeletex.Model, bear_mesh: skeletex.Mesh
) -> None:
    for size, bound in ((128, 2e-4), (64, 8e-4), (200, 3e-4)):
        mesh = skeletex.reconstruct(bear, size=size)
        topology = mesh.topology()
        assert topology["is_closed_manifold"] and topology["genus"] == 0 and topology["components"] == 1
        assert skeletex.metro(bear_mesh, mesh).mean < bound


def test_editing_the_texture_in_place_moves_the_surface_of_that_bone_alone(bear: skeletex.Model) -> None:
    model = bear.copy()
    assert model.texture.shape == (128, 128, 3) and model.texture.dtype == np.float32
    assert np.array_equal(model.texture, bear.texture) and not np.shares_memory(model.texture, bear.texture)
    before = skeletex.reconstruct(model)
    model.patch("left_ear")[...] *= 1.5
    after = skeletex.reconstruct(model)
    moved = np.abs(after.vertices - before.vertices).max(axis=1) > 1e-9 * before.diagonal
    bones = skeletex.triangle_bones(bear, before)
    ear = bear.skeleton.bone("left_ear")
    of_ear = np.zeros(len(moved), dtype=bool)
    of_ear[before.triangles[bones == ear]] = True
    of_others = np.zeros(len(moved), dtype=bool)
    of_others[before.triangles[bones != ear]] = True
    assert moved[of_ear & ~of_others].mean() > 0.99 and not moved[of_others].any()
    assert np.array_equal(skeletex.reconstruct(bear).vertices, before.vertices)


def test_a_texture_is_set_from_arrays_of_any_type_and_order(bear: skeletex.Model) -> None:
    model = bear.copy()
    model.texture = np.asfortranarray(bear.texture.astype(np.float64)) * 2
    assert np.array_equal(model.texture, bear.texture * 2)
    for values in (np.zeros((4, 4, 3)), np.zeros((128, 128, 3), dtype=complex)):
        with pytest.raises(skeletex.InputError, match="texture"):
            model.texture = values


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e6])
def test_a_texel_that_no_model_can_have_is_named(bear: skeletex.Model, value: float, tmp_path: Path) -> None:
    model = bear.copy()
    y, x = model.patches["head"].y + 2, model.patches["head"].x + 3
    model.texture[y, x, 1] = value
    with pytest.raises(skeletex.InputError, match=rf"texture\[{y}, {x}, 1\].*around"):
        skeletex.reconstruct(model)
    with pytest.raises(skeletex.InputError):
        model.write(tmp_path / "model.skx.exr")
    assert not list(tmp_path.iterdir())


def test_model_files_come_back_with_all_their_levels(tmp_path: Path, bear: skeletex.Model) -> None:
    levels = skeletex.levels(bear, smallest=32)
    assert [model.width for model in levels] == [128, 64, 32]
    skeletex.write_levels(tmp_path / "levels.skx.exr", levels)
    assert skeletex.model_levels(tmp_path / "levels.skx.exr") == [[128, 128], [64, 64], [32, 32]]
    for i, level in enumerate(levels):
        again = skeletex.Model.read(tmp_path / "levels.skx.exr", i)
        assert np.array_equal(again.texture, level.texture) and again.patches.keys() == level.patches.keys()


def test_a_translation_moves_the_mesh_and_the_skeleton_and_nothing_else(bear: skeletex.Model) -> None:
    way = np.array([3.0, -2.0, 0.5]) * bear.diagonal
    bind, moved = skeletex.reconstruct(bear), skeletex.reconstruct(bear, {"translation": way})
    assert np.array_equal(bind.triangles, moved.triangles)
    assert np.abs(moved.vertices - bind.vertices - way).max() < 2e-6 * bear.diagonal
    nodes = skeletex.pose(bear, {"translation": way}).nodes - bear.skeleton.nodes
    assert np.abs(nodes - way).max() < 1e-12 * bear.diagonal


def test_a_random_pose_is_closed_and_the_same_for_the_same_seed(bear: skeletex.Model) -> None:
    pose = skeletex.random_pose(bear, 30, seed=5)
    assert pose == skeletex.random_pose(bear, 30, seed=5) != skeletex.random_pose(bear, 30, seed=6)
    bind, posed = skeletex.reconstruct(bear), skeletex.reconstruct(bear, pose)
    assert posed.topology()["is_closed_manifold"]
    report = skeletex.deformation(bind, posed)
    assert 0.8 < report.volume_ratio < 1.2 and report.energy_mean >= 1
    assert skeletex.deformation(bind, skeletex.reconstruct(bear, pose, polish=True)).new_folds <= report.new_folds


def test_models_of_one_layout_have_textures_that_correspond(bear: skeletex.Model, bear_bis: skeletex.Model) -> None:
    corners = skeletex.morphs([bear, bear_bis], np.eye(2), layout=0, creases=True)
    for corner, own in zip(corners, (bear, bear_bis)):
        assert skeletex.metro(own, corner).mean < 5e-4
        assert all(a[:4] == b[:4] for a, b in zip(corner.patches.values(), bear.patches.values()))
    # The means of the texels are those of the morph, but for the angles that the skeletons between turn by.
    mean = skeletex.morph([bear, bear_bis], 0.5, layout=0, creases=True)
    change = np.linalg.norm(corners[1].texture - corners[0].texture)
    assert np.linalg.norm(mean.texture - (corners[0].texture + corners[1].texture) / 2) < 0.25 * change
    with pytest.raises(skeletex.InputError, match="weight"):
        skeletex.morph([bear, bear_bis], [1.2, -0.2])


def test_landmarks_are_the_program_s(
    tmp_path: Path, program: str, bear: skeletex.Model, bear_bis: skeletex.Model
) -> None:
    paths = [tmp_path / "a.skx.exr", tmp_path / "b.skx.exr"]
    for model, path in zip((bear, bear_bis), paths):
        model.write(path)
    models = [skeletex.Model.read(path) for path in paths]
    # The nose of one is to become what lies below the nose of the other.
    points = []
    for model in models:
        vertices = skeletex.reconstruct(model).vertices
        head = vertices[vertices[:, 1] > np.quantile(vertices[:, 1], 0.8)]
        points.append(head[np.argmax(head[:, 2])])
    vertices = skeletex.reconstruct(models[1]).vertices
    points[1] = vertices[np.argmin(np.linalg.norm(vertices - (points[1] - [0, 0.05, 0]), axis=1))]
    given = tmp_path / "landmarks.json"
    given.write_text(json.dumps({"landmarks": [{"name": "nose", "points": [list(point) for point in points]}]}))
    run(program, "morph", *paths, "--t", 0.5, "--landmarks", given, "-o", tmp_path / "half.skx.exr")
    skeletex.morph(models, 0.5, landmarks=[tuple(points)]).write(tmp_path / "own.skx.exr")
    assert (tmp_path / "own.skx.exr").read_bytes() == (tmp_path / "half.skx.exr").read_bytes()
    skeletex.morph(models, 0.5).write(tmp_path / "without.skx.exr")
    assert (tmp_path / "own.skx.exr").read_bytes() != (tmp_path / "without.skx.exr").read_bytes()
    for wrong in ([1, 2], [points[0]], "nose"):
        with pytest.raises(skeletex.InputError, match="landmarks"):
            skeletex.morph(models, 0.5, landmarks=wrong)  # type: ignore[arg-type]


def test_a_correspondence_names_bones(bear: skeletex.Model, bear_bis: skeletex.Model) -> None:
    found = skeletex.correspond(bear, bear_bis)
    assert found.bones == {name: name for name in bear.skeleton.bone_names} and 0 <= found.cost < 0.5
    with pytest.raises(skeletex.InputError):
        skeletex.correspond(bear, bear_bis, {"left_ear": "left_leg"})


def test_a_mirrored_model_is_the_mirror_image(bear: skeletex.Model) -> None:
    mirrored = skeletex.reconstruct(skeletex.mirror(bear))
    image = skeletex.reconstruct(bear)
    image.vertices[:, 0] *= -1
    result = skeletex.metro(image, mirrored)
    assert result.mean < 1e-7 and result.max < 1e-3  # a quad that bends both ways alike may take its other diagonal


def test_the_curvature_of_a_ball_is_one_over_its_radius() -> None:
    ball = skeletex.Mesh.read(ROOT / "build/meshes/geosphere.off")
    ball.vertices *= 3
    model = skeletex.encode(ball, skeletex.Skeleton([[-1, 0, 0], [1, 0, 0]], [[0, 1]]), size=64)
    mesh, values = skeletex.mean_curvature(model, scale=0.1)
    assert len(values) == len(mesh.vertices)
    # Averaging (I + scale^2 L)^-1 weakens places on a ball, which are eigenfunctions of L, by the eigenvalue 2 / r^2.
    radius = 1 / np.sqrt(12)  # in diagonals
    expected = 1 / 3 / (1 + 2 * 0.1**2 / radius**2)
    assert abs(np.median(values) / expected - 1) < 0.02 and np.abs(values / expected - 1).max() < 0.1


# Measuring


def test_distances_have_their_closed_form(bear_mesh: skeletex.Mesh) -> None:
    square = skeletex.Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    above = skeletex.Mesh(square.vertices + [0, 0, 0.25], square.triangles)
    result = skeletex.metro(square, above, samples=1000)
    for one in (result.forward, result.backward, result.vertex):
        assert np.allclose([one.mean, one.rms, one.max], 0.25 / np.sqrt(2), atol=1e-7) and abs(one.std) < 1e-6
    assert result.mean == (result.forward.mean + result.backward.mean) / 2
    assert np.allclose(skeletex.distances(square, [[0.5, 0.5, -2], [3, 0, 0]]), [2, 2])
    assert skeletex.metro(bear_mesh, bear_mesh).max < 1e-8


# What is wrong with an input


def test_findings_are_objects_and_encode_raises_the_same(
    bear_mesh: skeletex.Mesh, bear_skeleton: skeletex.Skeleton
) -> None:
    assert skeletex.validate(bear_mesh, bear_skeleton) == []
    pierced = bear_mesh.vertices.copy()
    pierced[0] = 2 * pierced.mean(axis=0) - pierced[0]
    findings = skeletex.validate(skeletex.Mesh(pierced, bear_mesh.triangles), bear_skeleton)
    assert ("warning", "self-intersection") in [(f.severity, f.rule) for f in findings]
    nodes = bear_skeleton.nodes.copy()
    ear = bear_skeleton.bones[bear_skeleton.bone("left_ear"), 1]
    nodes[ear] += 10 * bear_mesh.diagonal
    outside = skeletex.Skeleton(nodes, bear_skeleton.bones, bear_skeleton.node_names, bear_skeleton.bone_names)
    findings = skeletex.validate(bear_mesh, outside)
    (finding,) = [f for f in findings if f.rule == "node-inside"]
    assert finding.severity == "error" and finding.node == ear and finding.remedy
    assert bear_skeleton.node_names[ear] in finding.message
    with pytest.raises(skeletex.InvalidInput, match=bear_skeleton.node_names[ear]) as raised:
        skeletex.encode(bear_mesh, outside, size=64)
    assert "node-inside" in [f.rule for f in raised.value.findings]
    repaired, changes = skeletex.repair(bear_mesh, outside)
    assert changes and not [f for f in skeletex.validate(bear_mesh, repaired) if f.severity == "error"]


def test_an_open_mesh_is_said_to_be_open(bear_mesh: skeletex.Mesh, bear_skeleton: skeletex.Skeleton) -> None:
    is_open = skeletex.Mesh(bear_mesh.vertices, bear_mesh.triangles[:-1])
    assert "closed" in [f.rule for f in skeletex.validate(is_open, bear_skeleton)]
    assert [f.rule for f in skeletex.validate(is_open)] == ["closed"]
    assert skeletex.validate(bear_mesh) == []
    with pytest.raises(skeletex.InvalidInput) as raised:
        skeletex.skeletonize(is_open)
    assert "closed" in [f.rule for f in raised.value.findings]
    bear_mesh_copy = skeletex.Mesh(bear_mesh.vertices, bear_mesh.triangles[:, ::-1])
    with pytest.warns(skeletex.InputWarning, match="inside out|turned"):
        skeletex.encode(bear_mesh_copy, bear_skeleton, size=64)


def test_planes_that_cross_name_their_bone(bear_mesh: skeletex.Mesh) -> None:
    skeleton = skeletex.Skeleton.read(ROOT / "configs/skeletons/limits/bear_crossing_walls.skeleton.json")
    with pytest.raises(skeletex.TopologyError) as raised:
        skeletex.encode(bear_mesh, skeleton, size=64)
    bone, node = raised.value.bone, raised.value.node
    assert bone is not None or node is not None
    named = skeleton.bone_names[bone] if bone is not None else skeleton.node_names[node or 0]
    assert named in str(raised.value)


def test_errors_are_python_s_own_kinds_as_well(tmp_path: Path, bear: skeletex.Model) -> None:
    with pytest.raises(OSError, match="nowhere.off"):
        skeletex.Mesh.read(tmp_path / "nowhere.off")
    (tmp_path / "damaged.skx.exr").write_bytes(b"no picture")
    with pytest.raises(skeletex.IoError, match="damaged.skx.exr"):
        skeletex.Model.read(tmp_path / "damaged.skx.exr")
    with pytest.raises(ValueError, match="left_eer.*left_ear"):
        skeletex.reconstruct(bear, {"rotations": {"left_eer": {"axis": [0, 0, 1], "degrees": 3}}})
    with pytest.raises(skeletex.InputError, match="pose"):
        skeletex.reconstruct(bear, {"translation": [np.nan, 0, 0]})
    with pytest.raises(skeletex.DeviceError):
        skeletex.use_device("no such device")
    assert skeletex.use_device() in [device.name for device in skeletex.devices()]
    for error in (skeletex.IoError, skeletex.InputError, skeletex.TopologyError, skeletex.DeviceError):
        assert issubclass(error, skeletex.Error)


def test_models_are_shown_as_they_stand(bear: skeletex.Model) -> None:
    assert bear.up == (0, 1, 0) and bear.front == (0, 0, 1)
    same = skeletex.render(bear, size=(64, 64))
    assert np.array_equal(same, skeletex.render(bear, size=(64, 64), up=(0, 1, 0), front=(0, 0, 1)))
    assert not np.array_equal(same, skeletex.render(bear, size=(64, 64), up=(0, 0, 1)))
    page = skeletex.view(bear).html
    assert page == skeletex.view(bear, up="y").html and page != skeletex.view(bear, up="z").html


def test_options_out_of_range_are_refused_by_name(bear: skeletex.Model, bear_mesh: skeletex.Mesh) -> None:
    for name, call in {
        "size": lambda: skeletex.encode(bear_mesh, size=2),
        "method": lambda: skeletex.encode(bear_mesh, bear.skeleton, method="magic"),
        "rows": lambda: skeletex.encode(bear_mesh, rows="some"),
        "iterations": lambda: skeletex.encode(bear_mesh, iterations=1000),
        "boolean": lambda: skeletex.encode(bear_mesh, snap="yes"),  # type: ignore[arg-type]
        "time": lambda: skeletex.reconstruct(bear, {}, time=float("nan")),
        "deform": lambda: skeletex.reconstruct(bear, {}, deform="some"),
        "weight": lambda: skeletex.morph([bear, bear], [0.5, 0.6]),
        "blend": lambda: skeletex.transfer(bear, bear, {"head": "head"}, blend="some"),
        "no_bone": lambda: skeletex.transfer(bear, bear, {"no_bone": "head"}),
        "falloff": lambda: skeletex.smooth(bear, falloff=3),
        "mode": lambda: skeletex.render(bear, mode="some"),
        "colours": lambda: skeletex.render(bear, colours=np.zeros((3, 3))),
        "up": lambda: skeletex.view(bear, up="x"),
    }.items():
        with pytest.raises(skeletex.InputError, match=name):
            call()


# Skeletons


def test_a_made_skeleton_is_one_that_encode_takes(bear_mesh: skeletex.Mesh) -> None:
    skeleton = skeletex.skeletonize(bear_mesh, bones=8)
    assert 1 <= len(skeleton.bones) <= 8
    assert not [f for f in skeletex.validate(bear_mesh, skeleton) if f.severity == "error"]


# Long work


def test_progress_comes_in_order_and_can_cancel(bear_mesh: skeletex.Mesh, bear_skeleton: skeletex.Skeleton) -> None:
    calls: list[tuple[str, float]] = []
    skeletex.encode(bear_mesh, bear_skeleton, size=64, progress=lambda *call: calls.append(call))
    shares = [done for _, done in calls]
    assert shares == sorted(shares) and shares[-1] == 1 and len(shares) >= 4
    with pytest.raises(skeletex.Cancelled):
        skeletex.encode(bear_mesh, bear_skeleton, size=64, progress=lambda stage, done: done < 0.5)

    def fail(stage: str, done: float) -> None:
        raise KeyError(stage)

    with pytest.raises(KeyError, match="half edges"):
        skeletex.encode(bear_mesh, bear_skeleton, size=64, progress=fail)
    assert skeletex.encode(bear_mesh, bear_skeleton, size=64).width == 64


def test_ctrl_c_ends_a_call_before_it_is_done(bear_mesh: skeletex.Mesh, bear_skeleton: skeletex.Skeleton) -> None:
    def encode() -> float:
        begin = time.monotonic()
        try:
            skeletex.encode(bear_mesh, bear_skeleton, size=512)
        except KeyboardInterrupt:
            return time.monotonic() - begin
        return -(time.monotonic() - begin)

    encode()  # kernels are there
    whole = -encode()
    timer = threading.Timer(0.02 * whole, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    interrupted = encode()
    timer.join()
    assert 0 < interrupted < 0.8 * whole


def test_other_threads_run_meanwhile_and_results_do_not_depend_on_them(
    bear_mesh: skeletex.Mesh, bear_skeleton: skeletex.Skeleton, bear: skeletex.Model
) -> None:
    results: list[Any] = [None] * 4

    def work(i: int) -> None:
        results[i] = (
            skeletex.encode(bear_mesh, bear_skeleton, size=128).texture if i % 2 else skeletex.reconstruct(bear).vertices
        )

    threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    ticks = 0
    while any(thread.is_alive() for thread in threads):
        time.sleep(0.001)
        ticks += 1
    assert np.array_equal(results[1], bear.texture) and np.array_equal(results[3], bear.texture)
    assert np.array_equal(results[0], results[2])
    assert ticks > 40  # with Python's lock held, four calls leave a handful


# Pictures


def test_pictures_show_what_they_are_asked_for(bear: skeletex.Model) -> None:
    shaded = skeletex.render(bear, size=(200, 150))
    assert shaded.shape == (150, 200, 3) and shaded.dtype == np.uint8
    assert (shaded[0] == 255).all() and (shaded < 200).any(axis=2).mean() > 0.1
    clear = skeletex.render(bear, size=(200, 150), background=None)
    assert clear.shape == (150, 200, 4) and (clear[0, :, 3] == 0).all() and clear[75, 100, 3] == 255
    pictures = [skeletex.render(bear, mode=mode, size=(200, 150)) for mode in ("segments", "checker", "normals", "map")]
    pictures += [shaded, skeletex.render(bear, {"translation": [0, 0, 0]}, skeleton=True, size=(200, 150))]
    for i, one in enumerate(pictures):
        assert all(one.shape != other.shape or (one != other).mean() > 0.005 for other in pictures[:i])


def test_colours_and_values_are_painted(bear: skeletex.Model) -> None:
    mesh = skeletex.reconstruct(bear)
    for count in (len(mesh.vertices), len(mesh.triangles)):
        red = skeletex.render(mesh, colours=np.tile([1.0, 0, 0], (count, 1)), size=(200, 150), background=None)
        body = red[red[..., 3] == 255]
        assert body[:, 0].mean() > 100 and body[:, 1:3].max() < 60
    assert np.array_equal(skeletex.viridis([0, 1, 2]), skeletex.viridis([5, 6, 9], (5, 7)))


def test_a_page_shows_itself_in_a_notebook(bear: skeletex.Model, tmp_path: Path) -> None:
    try:
        page = skeletex.view(bear, name="bear <3", size=64)
    except skeletex.InputError as error:
        pytest.skip(str(error))
    shown = page._repr_html_()
    srcdoc = re.fullmatch(r'<iframe srcdoc="([^"]*)".*</iframe>', shown, re.DOTALL)
    assert srcdoc and "<" not in srcdoc.group(1)
    assert html.unescape(srcdoc.group(1)) == page.html
    page.write(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == page.html
    with pytest.raises(skeletex.IoError):
        page.write(tmp_path / "nowhere" / "page.html")


def test_the_page_runs_inside_a_notebook(bear: skeletex.Model, tmp_path: Path) -> None:
    node, browser = shutil.which("node"), shutil.which("chromium")
    modules = os.environ.get("SKELETEX_NODE_MODULES", str(ROOT / "build/release/core/page/node_modules"))
    if not node or not browser or not os.path.isdir(os.path.join(modules, "playwright-core")):
        pytest.skip("Node.js, Chromium or playwright-core is not installed")
    shown = skeletex.view(bear, size=64)._repr_html_()
    (tmp_path / "notebook.html").write_text(f"<!doctype html><body>{shown}</body>", encoding="utf-8")
    script = Path(__file__).with_name("notebook.mjs")
    result = subprocess.run(
        [node, script, tmp_path / "notebook.html", modules, browser], capture_output=True, text=True, timeout=300
    )
    assert result.returncode == 0, result.stdout + result.stderr


# Documentation


def test_everything_public_has_a_docstring_and_a_place_on_the_page() -> None:
    page = (ROOT / "docs/python.md").read_text(encoding="utf-8")
    for name in skeletex.__all__:
        if name == "__version__":
            continue
        thing = getattr(skeletex, name)
        assert inspect.getdoc(thing), name
        assert re.search(rf"\b{name}\b", page), f"{name} is not in docs/python.md"
        for member, value in vars(thing).items() if inspect.isclass(thing) else ():
            if not member.startswith("_") and (callable(value) or isinstance(value, property)):
                assert inspect.getdoc(value), f"{name}.{member}"
