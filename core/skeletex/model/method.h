// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <vector>

namespace skeletex {

/// A parameterization method, by its place in the table of methods: what a model's patch stores. The enumerators are
/// those of the library; a program can add more, see register_method in convert/parameterize/method.h. Code that treats
/// a model asks for the traits below, never for one of the methods.
enum class Method : int { kSpd, kVsm };

/// What a model's patch has in common with all others of its method.
struct MethodTraits {
  std::string name;  ///< in model files and on the command line
  /// The texels are points on the rays of the patch's frames: (0, 0, distance). Otherwise they are points of a map of
  /// the surface's triangles, and may lie anywhere around the ray.
  bool is_height_field = false;
};

const MethodTraits& traits_of(Method method);
inline bool is_height_field(Method method) { return traits_of(method).is_height_field; }
inline const std::string& to_string(Method method) { return traits_of(method).name; }

/// All methods, in the order of the table.
std::vector<Method> all_methods();
/// Their names, in the same order.
std::vector<std::string> method_names();
/// \throw InputError that lists the known names
Method method_named(const std::string& name);

/// Adds a method to the table. Models that name it can then be read.
/// \pre no other thread uses the table
/// \throw InputError when the name is taken
Method add_method_traits(MethodTraits traits);

}  // namespace skeletex
