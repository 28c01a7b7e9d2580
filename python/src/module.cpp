// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include "bind.h"

namespace skeletex::python {
namespace {

std::string list_of(const std::vector<Finding>& findings) {
  std::string text;
  for (const Finding& finding : findings) {
    if (finding.severity != Severity::kError) continue;
    if (!text.empty()) text += '\n';
    text += fmt::format("{}: {}", finding.rule, finding.message);
    if (!finding.remedy.empty()) text += fmt::format("\n  remedy: {}", finding.remedy);
  }
  return text;
}

/// The class of that name in the package.
py::object error_class(const char* name) { return py::module_::import("skeletex._errors").attr(name); }

void raise(const char* name, const Error& error) { PyErr_SetString(error_class(name).ptr(), error.what()); }

/// Raises an object with more than a message.
void raise_with(const char* name, const Error& error, const std::function<void(py::object&)>& fill) {
  const py::object type = error_class(name);
  py::object value = type(error.what());
  fill(value);
  PyErr_SetObject(type.ptr(), value.ptr());
}

void translate(std::exception_ptr exception) {
  if (!exception) return;
  try {
    std::rethrow_exception(exception);
  } catch (const InvalidInput& error) {
    raise_with("InvalidInput", error,
               [&](py::object& value) { value.attr("_set_findings")(findings_list(error.findings())); });
  } catch (const TopologyError& error) {
    raise_with("TopologyError", error, [&](py::object& value) {
      if (error.bone() >= 0) value.attr("bone") = static_cast<int>(error.bone());
      if (error.node() >= 0) value.attr("node") = static_cast<int>(error.node());
    });
  } catch (const InputError& error) {
    raise("InputError", error);
  } catch (const IoError& error) {
    raise("IoError", error);
  } catch (const DeviceError& error) {
    raise("DeviceError", error);
  } catch (const Cancelled& error) {
    raise("Cancelled", error);
  } catch (const Error& error) {
    raise("Error", error);
  } catch (const nlohmann::json::exception& error) {  // an option of another type
    raise("InputError", InputError(std::string("an option: ") + error.what()));
  }
}

}  // namespace

InvalidInput::InvalidInput(std::vector<Finding> findings)
    : InputError(list_of(findings)), findings_(std::move(findings)) {}

void bind_errors() { py::register_exception_translator(translate); }

}  // namespace skeletex::python

PYBIND11_MODULE(_core, module) {
  using namespace skeletex::python;
  module.doc() = "Functions of the library on plain arrays; use the package skeletex, which calls them.";
  module.attr("version") = SKELETEX_VERSION;
  bind_errors();
  bind_model(module);
  bind_convert(module);
  bind_edit(module);
  bind_measure(module);
  bind_draw(module);
}
