// SPDX-License-Identifier: MIT
#pragma once
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "skeletex/device/context.h"

namespace skeletex {

/// A stage of the pipeline on one input, and what it is measured against, ready to be run any number of times.
struct Stage {
  std::string name;       ///< "reconstruct"
  std::string model;      ///< of the input
  int size = 0;           ///< texels along the longer side; of stages without a texture the mesh's triangles
  std::string reference;  ///< what run_reference does, in words
  /// What counts is the kernels' own time, as the reference is a device copy; else the wall clock.
  bool is_device_time = false;
  std::function<void()> run;
  std::function<double()> run_reference;  ///< \return milliseconds
  /// Where what counts is neither: milliseconds of the last run, after that of the reference.
  std::function<double()> counted_ms;
  /// Numbers about the last runs, by name; may be empty.
  std::function<std::vector<std::pair<std::string, double>>()> details;
};

/// One run of a stage and one of its reference.
struct StageSample {
  double ms = 0;  ///< what counts: device_ms or wall_ms
  double wall_ms = 0, device_ms = 0, reference_ms = 0;
  double launches = 0;  ///< of kernels
};
StageSample run_once(ClContext& context, const Stage& stage);

struct StageSamples {
  std::vector<StageSample> samples;
  double median(double StageSample::*value) const;
  double least(double StageSample::*value) const;
  double most(double StageSample::*value) const;
  /// The stage's median time divided by its reference's.
  double ratio() const { return median(&StageSample::ms) / median(&StageSample::reference_ms); }
};

struct Repeats {
  int most = 15;
  int least = 3;
  double seconds = 2;  ///< no further repeat begins after so long
  int warm_ups = 1;
};
/// Stage and reference in alternation, after warm-ups that do not count.
/// \param after_each  called after every run with the share that is done
StageSamples measure(ClContext& context, const Stage& stage, const Repeats& repeats,
                     const std::function<void(double)>& after_each = {});

/// Milliseconds of the wall clock that the work takes.
double wall_ms(const std::function<void()>& work);

/// A device copy that reads and writes `floats` in all.
/// \return what runs it and says its milliseconds on the device
std::function<double()> device_copy(ClContext& context, std::size_t floats);

}  // namespace skeletex
