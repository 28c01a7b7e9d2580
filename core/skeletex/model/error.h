// SPDX-License-Identifier: MIT
#pragma once
#include <stdexcept>
#include <string>
#include <string_view>

#include "skeletex/geometry/index.h"

namespace skeletex {

/// Base of everything the library throws. The message says what is wrong, where, and what to do about it.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};
/// A file could not be read or written, or is not what its name says.
class IoError : public Error {
 public:
  using Error::Error;
};
/// Mesh, skeleton or options are not usable as they are.
class InputError : public Error {
 public:
  using Error::Error;
};
/// Mesh and skeleton do not fit together: a segment is no tube, disk or sphere.
class TopologyError : public Error {
 public:
  using Error::Error;
  /// \param bone  of the skeleton, where one stands in the way; -1: none
  /// \param node  the one to move; -1: none
  TopologyError(const std::string& message, BoneIndex bone, NodeIndex node)
      : Error(message), bone_(bone), node_(node) {}
  BoneIndex bone() const { return bone_; }
  NodeIndex node() const { return node_; }

 private:
  BoneIndex bone_;
  NodeIndex node_;
};
/// An OpenCL call failed.
class DeviceError : public Error {
 public:
  using Error::Error;
};

/// Text as a terminal may show it: control characters but line ends and tabs become \xNN, so that a name in a file
/// cannot steer the terminal. The program prints nothing else.
std::string printable(std::string_view text);

}  // namespace skeletex
