// SPDX-License-Identifier: MIT
#pragma once
#include <string>

#include "experiment.h"

namespace skeletex {

/// The value at "encode.bones.0.area"; null where there is none.
OrderedJson value_at(const OrderedJson& json, const std::string& place);

/// What is wrong with an item whose steps have all succeeded, by the experiment's checks; "" where nothing is.
/// \param steps  what they reported
std::string failed_check(const Experiment& experiment, const OrderedJson& steps);

/// The row of results.json for an item as its file in items/ has it.
OrderedJson row_of(const Experiment& experiment, const OrderedJson& item);

/// How often each outcome occurs, in a fixed order, those that never occur left out.
OrderedJson count_outcomes(const OrderedJson& rows);

/// Writes results.json and results.csv.
/// \return what results.json holds
/// \throw IoError
OrderedJson write_results(const std::filesystem::path& folder, const Experiment& experiment, OrderedJson rows);

}  // namespace skeletex
