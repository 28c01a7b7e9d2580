// SPDX-License-Identifier: MIT
#include "command.h"
#include "files.h"

namespace skeletex::cli {

void add_commands(CLI::App& program) {
  add_encode_command(program);
  add_skeletonize_command(program);
  add_reconstruct_command(program);
  add_render_command(program);
  add_view_command(program);
  add_correspond_command(program);
  add_morph_command(program);
  add_filter_command(program);
  add_lod_command(program);
  add_pack_command(program);
  add_unpack_command(program);
  add_export_command(program);
  add_import_command(program);
  add_transfer_command(program);
  add_pose_random_command(program);
  add_weights_command(program);
  add_metro_command(program);
  add_segment_command(program);
  add_validate_command(program);
  add_inspect_command(program);
  add_bench_command(program);
  add_run_command(program);
  add_collect_command(program);
  add_replay_command(program);
  add_devices_command(program);
  add_help_command(program);
  add_completions_command(program);
  add_manual_command(program);
  for (const char* name : {"help", "manual"})
    take_command(*program.get_subcommand(name)->get_option("COMMAND"), program);
  for (CLI::App* command : program.get_subcommands([](const CLI::App*) { return true; }))
    command->parse_complete_callback([command] { check_files(*command); });
}

}  // namespace skeletex::cli
