// SPDX-License-Identifier: MIT
#pragma once
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <exception>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "skeletex/analysis/validate_input.h"
#include "skeletex/device/context.h"
#include "skeletex/model/error.h"
#include "skeletex/model/texture.h"

/// The module skeletex._core: whole functions of the library on numpy arrays. The package skeletex in front of it has
/// the signatures, defaults and docstrings that a user sees, and makes arrays of the types that are taken here.
namespace skeletex::python {

namespace py = pybind11;

using Points = py::array_t<double, py::array::c_style | py::array::forcecast>;  ///< n x 3
using Indices = py::array_t<int, py::array::c_style | py::array::forcecast>;    ///< n x 3, of bones n x 2
using Numbers = py::array_t<float, py::array::c_style | py::array::forcecast>;  ///< any shape
using Bytes = py::array_t<std::uint8_t, py::array::c_style | py::array::forcecast>;

/// A mesh with errors, which the message lists.
class InvalidInput : public InputError {
 public:
  explicit InvalidInput(std::vector<Finding> findings);
  const std::vector<Finding>& findings() const { return findings_; }

 private:
  std::vector<Finding> findings_;
};
/// The caller's progress function has said no.
class Cancelled : public Error {
 public:
  using Error::Error;
};

/// A model whose texels the caller can edit: they live in an array of Python.
struct Model {
  std::shared_ptr<const SkeletexModel> rest;  ///< its texture has a size and no texels
  Numbers planes;                             ///< along, around, out: 3 x height x width
};
Model model_of(SkeletexModel model);
/// A copy with its texels as they are now, which nobody edits while it is used.
/// \throw InputError naming a texel that is not finite or out of all proportion
SkeletexModel whole(const Model& model);

/// \param name  of the argument, for messages
/// \throw InputError when its shape is wrong
std::vector<Vec3> points_of(const Points& points, const char* name);
std::vector<Triangle> triangles_of(const Indices& triangles);
TriangleMesh mesh_of(const Points& vertices, const Indices& triangles);
py::tuple arrays_of(const TriangleMesh& mesh);
Points points_array(const std::vector<Vec3>& points);
template <class T>
py::array_t<T> array_of(const std::vector<T>& values) {
  return py::array_t<T>(static_cast<py::ssize_t>(values.size()), values.data());
}

/// A skeleton in the user's units as Python has it: names and places of the nodes, names and ends of the bones, and
/// each bone's s, NaN where it has none.
struct SkeletonArrays {
  std::vector<std::string> node_names;
  Points nodes;
  std::vector<std::string> bone_names;
  Indices bones;
  Points s;
};
SkeletonArrays skeleton_arrays(const py::tuple& skeleton);
Skeleton skeleton_of(const py::tuple& skeleton);
py::tuple tuple_of(const Skeleton& skeleton);

py::list findings_list(const std::vector<Finding>& findings);

/// The JSON of the package's own functions.
nlohmann::json parse_own_json(const std::string& text);

/// The one context of the process. Its owner has the lock, and not Python's.
class DeviceLock {
 public:
  DeviceLock();
  ~DeviceLock();
  DeviceLock(const DeviceLock&) = delete;
  DeviceLock& operator=(const DeviceLock&) = delete;
  ClContext& context();
};
/// Another device from now on.
/// \param selector  as ClContext takes it; empty: the default
void choose_device(const std::string& selector);

/// Runs work(context) while other threads of Python go on.
template <class Work>
auto run(Work&& work) {
  const py::gil_scoped_release released;
  DeviceLock lock;
  return work(lock.context());
}

/// What a long step of the library calls: looks for Ctrl-C, then asks the caller's function.
class Progress {
 public:
  explicit Progress(py::object callback) : callback_(std::move(callback)) {}
  std::function<bool(const std::string&, double)> function();
  /// What the caller's function or Ctrl-C has raised, instead of the library's own error.
  void rethrow() const;

 private:
  bool is_wanted(const std::string& stage, double done);

  py::object callback_;
  std::exception_ptr raised_;
  bool is_cancelled_ = false;
};

/// Runs work(context, progress).
template <class Work>
auto run_watched(const py::object& callback, Work&& work) {
  Progress progress(callback);
  try {
    return run([&](ClContext& context) { return work(context, progress.function()); });
  } catch (const Error&) {
    progress.rethrow();
    throw;
  }
}

void bind_errors();
void bind_model(py::module_& module);
void bind_convert(py::module_& module);
void bind_edit(py::module_& module);
void bind_measure(py::module_& module);
void bind_draw(py::module_& module);

}  // namespace skeletex::python
