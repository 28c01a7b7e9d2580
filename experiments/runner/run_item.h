// SPDX-License-Identifier: MIT
#pragma once
#include <map>
#include <string>

#include "run_experiment.h"

namespace skeletex {

/// Runs an item's steps, each in a process of its own, within the experiment's limits. Its outcome is
///   success        every step ended as it should, and the experiment's checks hold
///   refused        a step ended with an error; "reason" has its words
///   out of memory  a step said so, or the system ended it
///   out of time    the steps took longer than the limit
///   crashed        a signal ended a step
///   wrong          a check does not hold, a step succeeded that was to be refused, or its command is not understood
///                  (exit code 2)
/// Its log, what was called and what it printed to standard error, goes to items/KEY.log in the results.
/// \param environment  of the processes, on top of this one's own
/// \return what items/KEY.json holds
/// \throw IoError when a file cannot be written or a {name} in a step is unknown
OrderedJson run_item(const Experiment& experiment, const Item& item, const RunOptions& options,
                     const OrderedJson& signature, const std::map<std::string, std::string>& environment);

/// Whether a program that failed with these words had too little memory.
bool tells_of_memory(const std::string& errors);

}  // namespace skeletex
