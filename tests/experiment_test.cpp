// SPDX-License-Identifier: MIT
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <set>
#include <string>

#include "runner/process.h"
#include "runner/run_experiment.h"
#include "runner/run_item.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/read_file.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/model/error.h"
#include "skeletex/model/memory.h"
#include "support/scratch.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

/// An experiment in a folder of its own whose steps are shell commands: "tool" instead of the program.
class Runner : public ::testing::Test {
 protected:
  Runner() {
    const Shape shape = y_shape();
    write_mesh(folder_ / "y.ply", shape.mesh);
    std::ofstream(folder_ / "y.skeleton.json") << skeleton_to_json(shape.skeleton);
  }
  std::filesystem::path write(const std::string& text) {
    std::ofstream(folder_ / "e.json") << text;
    return folder_ / "e.json";
  }
  std::string refusal(const std::string& text, const ExperimentChanges& changes = {}) {
    try {
      plan_items(read_experiment(write(text), changes));
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  }
  RunSummary run(const Experiment& experiment, bool is_resumed = false, int jobs = 1) {
    return run_experiment(experiment, {.program = "/bin/false",
                                       .folder = folder_ / "out",
                                       .is_resumed = is_resumed,
                                       .jobs = jobs,
                                       .shard = 1,
                                       .shards = 1,
                                       .device = "",
                                       .source = {},
                                       .progress = {}});
  }
  RunSummary run_shard(const Experiment& experiment, int shard, int shards, bool is_resumed = false) {
    return run_experiment(experiment, {.program = "/bin/false",
                                       .folder = folder_ / "parts",
                                       .is_resumed = is_resumed,
                                       .jobs = 1,
                                       .shard = shard,
                                       .shards = shards,
                                       .device = "",
                                       .source = {},
                                       .progress = {}});
  }
  std::string collect_refusal() {
    try {
      collect_shards({folder_ / "parts"}, folder_ / "parts");
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  }
  static constexpr const char* kModel = R"({"name": "y", "mesh": "y.ply", "skeleton": "y.skeleton.json"})";
  ScratchFolder folder_;
};

bool holds(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST_F(Runner, EveryModelAndEveryCombinationIsAnItemOfItsOwn) {
  const Experiment experiment = read_experiment(write(fmt::format(
      R"({{"name": "e", "models": [{}], "sweep": {{"size": [32, 64], "recipe": ["a", {{"label": "b", "arguments": ["--x", "{{size}}"], "values": {{"other": "o"}}}}]}},
          "steps": [{{"name": "s", "run": ["{{model}}", "{{recipe}}", "{{size}}.{{recipe}}"]}}]}})",
      kModel)));
  const std::vector<Item> items = plan_items(experiment);
  std::set<std::string> keys;
  for (const Item& item : items) keys.insert(item.key);
  EXPECT_EQ(keys, (std::set<std::string>{"y-32-a", "y-32-b", "y-64-a", "y-64-b"}));
  for (const Item& item : items)
    if (item.key == "y-64-b") {
      EXPECT_EQ(fill_arguments(experiment, item, experiment.steps[0].run, {}),
                (std::vector<std::string>{"y", "--x", "64", "64.b"}));
      EXPECT_EQ(fill_arguments(experiment, item, {"{other}"}, {}), std::vector<std::string>{"o"});
    }
}

TEST_F(Runner, SaysWhatIsWrongWithAnExperimentAndWhatWasMeant) {
  const std::string steps = R"("steps": [{"name": "s", "run": ["x"]}])";
  EXPECT_TRUE(holds(refusal(R"({"name": "e", "swep": {}, )" + steps + "}"), "did you mean sweep?"));
  EXPECT_TRUE(holds(refusal(R"({"name": "e"})"), "\"steps\""));
  EXPECT_TRUE(holds(refusal("{" + steps + "}"), "\"name\" is missing"));
  EXPECT_TRUE(holds(refusal(R"({"name": "e", "sweep": {"a": []}, )" + steps + "}"), "has no values"));
  EXPECT_TRUE(holds(refusal(R"({"name": "e", "sweep": {"a": [1, 1]}, )" + steps + "}"), "two items"));
  EXPECT_TRUE(holds(refusal(R"({"name": "e", "steps": [{"name": "s", "runs": []}]})"), "did you mean run?"));
  EXPECT_TRUE(holds(refusal(R"({"name": "e", "columns": {"c": "t.x"}, )" + steps + "}"), "no step"));
  EXPECT_TRUE(holds(refusal(R"({"name": "e", "models": ["absent.json"], )" + steps + "}"), "absent.json"));
  EXPECT_TRUE(holds(refusal("{\n\"name\": }"), "line 2"));
  EXPECT_TRUE(holds(
      refusal(R"({"name": "e", )" + steps + "}", {.settings = {"size"}, .is_quick = false, .only = {}, .models = {}}),
      "KEY=VALUE"));
  EXPECT_EQ(refusal(R"({"name": "e", )" + steps + "}"), "accepted");
  const Experiment experiment = read_experiment(write(R"({"name": "e", "sweep": {"a": ["{a}"]}, )" + steps + "}"));
  EXPECT_THROW(fill_arguments(experiment, plan_items(experiment)[0], {"{absent}"}, {}), IoError);
  EXPECT_THROW(fill_arguments(experiment, plan_items(experiment)[0], {"x{a}"}, {}), IoError);  // stands for itself
}

TEST_F(Runner, SettingsQuickAndOnlyChangeTheExperiment) {
  const std::filesystem::path file = write(fmt::format(
      R"({{"name": "e", "models": [{}], "sweep": {{"size": [32, 64]}}, "steps": [{{"name": "s", "run": []}}], "quick": {{"sweep.size": [8]}}}})",
      kModel));
  EXPECT_EQ(plan_items(read_experiment(file)).size(), 2u);
  EXPECT_EQ(plan_items(read_experiment(file, {.settings = {}, .is_quick = true, .only = {}, .models = {}}))[0].key,
            "y-8");
  EXPECT_EQ(plan_items(
                read_experiment(file, {.settings = {"sweep.size=[1,2,3]"}, .is_quick = true, .only = {}, .models = {}}))
                .size(),
            3u);
  EXPECT_THROW(read_experiment(file, {.settings = {}, .is_quick = false, .only = {"z"}, .models = {}}), InputError);
}

TEST_F(Runner, RecordsAFailureWithItsReasonAndGoesOn) {
  const Experiment experiment = read_experiment(write(
      R"({"name": "e", "sweep": {"n": [0, 3, 0.5]}, "steps": [{"name": "s", "tool": "sh", "run": ["-c", "echo because >&2; printf 12345 > {out}/f{n}; exit {n}"], "file_sizes": {"bytes": "{out}/f{n}"}},
          {"name": "kill", "tool": "sh", "run": ["-c", "test {n} = 0 || kill -9 $$"]}], "columns": {"bytes": "s.bytes"}})"));
  const RunSummary summary = run(experiment, false, 2);
  EXPECT_EQ(summary.done, 1);
  EXPECT_EQ(summary.failed, 2);
  const OrderedJson& rows = summary.results.at("rows");
  EXPECT_EQ(rows[0].at("columns").at("bytes"), 5);
  EXPECT_EQ(rows[1].at("reason"), "because");
  for (const char* file : {"results.json", "results.csv", "record.json", "items/0.json", "items/3.json"})
    EXPECT_TRUE(std::filesystem::exists(folder_ / "out" / file)) << file;
  EXPECT_TRUE(holds(read_file(folder_ / "out/results.csv"), "because"));
  const OrderedJson record = OrderedJson::parse(read_file(folder_ / "out/record.json"));
  for (const char* key :
       {"date", "source", "experiment", "inputs", "git", "compiler", "device", "machine", "seconds", "peak_memory_mb"})
    EXPECT_TRUE(record.contains(key)) << key;
}

TEST_F(Runner, ResumesWhatIsDoneUnlessCommitCommandsOrInputsChanged) {
  const std::string text = fmt::format(
      R"({{"name": "e", "models": [{}], "sweep": {{"n": [1, 2]}}, "steps": [{{"name": "s", "tool": "sh", "run": ["-c", "echo x >> {{out}}/log; test {{n}} = 1"]}}]}})",
      kModel);
  const auto runs = [&] { return read_file(folder_ / "out/log").size() / 2; };
  run(read_experiment(write(text)));
  EXPECT_EQ(runs(), 2u);
  const RunSummary again = run(read_experiment(write(text)), true);
  EXPECT_EQ(again.kept, 1);  // the one that failed runs again
  EXPECT_EQ(runs(), 3u);
  std::ofstream(folder_ / "y.skeleton.json", std::ios::app) << "\n";
  EXPECT_EQ(run(read_experiment(write(text)), true).kept, 0);
  // What another commit has made is not kept: the record would name the wrong one.
  const auto item = folder_ / "out/items/y-1.json";
  OrderedJson made = OrderedJson::parse(read_file(item));
  EXPECT_EQ(run(read_experiment(write(text)), true).kept, 1);
  made["signature"]["commit"] = "another";
  std::ofstream(item) << made.dump();
  EXPECT_EQ(run(read_experiment(write(text)), true).kept, 0);
}

/// Items that end in every way; {json} stands for a way to write the step's JSON without braces.
constexpr const char* kOutcomes = R"({"name": "e", "limits": {"seconds": 3, "memory_mb": 400},
  "sweep": {"how": [
    {"label": "right", "values": {"script": "echo 4"}},
    {"label": "refuses", "values": {"script": "echo no such bone >&2; exit 1"}},
    {"label": "misuses", "values": {"script": "echo unknown option >&2; exit 2"}},
    {"label": "sleeps", "values": {"script": "sleep 100 | sleep 100"}},
    {"label": "crashes", "values": {"script": "kill -SEGV $$"}},
    {"label": "killed", "values": {"script": "kill -KILL $$"}},
    {"label": "takes", "values": {"script": "exec python3 -c 'bytearray(10**9)'"}},
    {"label": "wrong", "values": {"script": "echo 5"}}]},
  "steps": [{"name": "s", "tool": "bash", "run": ["-c", "{script}"]},
            {"name": "t", "tool": "bash", "run": ["-c", "test {how} = wrong || printf '%b' '\\x7b\"v\": 4\\x7d' > {work}/t.json"]}],
  "columns": {"v": "t.v"}, "checks": {"v": {"equals": 4}}})";

TEST_F(Runner, CountsHowEachItemEndsWithinItsLimits) {
  const RunSummary summary = run(read_experiment(write(kOutcomes)), false, 2);
  std::map<std::string, std::string> outcomes;
  for (const OrderedJson& row : summary.results.at("rows")) {
    outcomes[row.at("key").get<std::string>()] = row.at("outcome").get<std::string>();
    EXPECT_LT(row.at("seconds").get<double>(), 20);
  }
  EXPECT_EQ(outcomes, (std::map<std::string, std::string>{{"right", "success"},
                                                          {"refuses", "refused"},
                                                          {"misuses", "wrong"},
                                                          {"sleeps", "out of time"},
                                                          {"crashes", "crashed"},
                                                          {"killed", "out of memory"},
                                                          {"takes", "out of memory"},
                                                          {"wrong", "wrong"}}));
  EXPECT_EQ(summary.results.at("outcomes").at("out of memory"), 2);
  EXPECT_EQ(summary.done, 1);
  EXPECT_EQ(summary.failed, 7);
  const std::string log = read_file(folder_ / "out/items/refuses.log");
  EXPECT_TRUE(holds(log, "no such bone") && holds(log, "bash -c")) << log;
  EXPECT_TRUE(holds(read_file(folder_ / "out/results.csv"), "v is null, and 4 is right"));
}

TEST_F(Runner, ShardsTogetherMakeTheResultsOfOneRun) {
  const Experiment experiment = read_experiment(write(
      R"({"name": "e", "sweep": {"a": [1, 2, 3], "b": ["x", "y", "z"]}, "steps": [{"name": "s", "tool": "sh", "run": ["-c", "printf {a}{b} > {out}/{a}{b}; test {a}{b} != 2z"], "file_sizes": {"n": "{out}/{a}{b}"}}], "columns": {"n": "s.n"}})"));
  const OrderedJson whole = run(experiment).results;
  std::multiset<std::string> keys;
  for (const int shard : {4, 2, 1, 3}) {
    const RunSummary part = run_shard(experiment, shard, 4);
    for (const OrderedJson& row : part.results.at("rows")) keys.insert(row.at("key").get<std::string>());
  }
  EXPECT_EQ(keys.size(), 9u);
  EXPECT_EQ(std::set<std::string>(keys.begin(), keys.end()).size(), 9u);
  const Collected collected = collect_shards({folder_ / "parts"}, folder_ / "parts");
  EXPECT_EQ(collected.summary.done, 8);
  EXPECT_EQ(collected.summary.failed, 1);
  OrderedJson parts = OrderedJson::parse(read_file(folder_ / "parts/results.json"));
  OrderedJson one = OrderedJson::parse(read_file(folder_ / "out/results.json"));
  for (OrderedJson* results : {&parts, &one})
    for (OrderedJson& row : results->at("rows")) row["seconds"] = row["peak_memory_mb"] = 0;
  EXPECT_EQ(parts.dump(), one.dump());
  const OrderedJson record = OrderedJson::parse(read_file(folder_ / "parts/record.json"));
  const OrderedJson whole_record = OrderedJson::parse(read_file(folder_ / "out/record.json"));
  for (const auto& [key, value] : whole_record.items()) EXPECT_TRUE(record.contains(key)) << key;
  EXPECT_EQ(record.at("shards").size(), 4u);

  // Shards of several machines, each with a folder of its own.
  std::filesystem::create_directories(folder_ / "second/shards");
  std::filesystem::create_directories(folder_ / "second/items");
  std::filesystem::rename(folder_ / "parts/shards/3-of-4.json", folder_ / "second/shards/3-of-4.json");
  const OrderedJson third = OrderedJson::parse(read_file(folder_ / "second/shards/3-of-4.json"));
  for (const OrderedJson& key : third.at("shard").at("keys"))
    std::filesystem::rename(folder_ / ("parts/items/" + key.get<std::string>() + ".json"),
                            folder_ / ("second/items/" + key.get<std::string>() + ".json"));
  EXPECT_TRUE(holds(collect_refusal(), "are missing: 3"));
  EXPECT_EQ(collect_shards({folder_ / "parts", folder_ / "second"}, folder_ / "all").summary.done, 8);
  EXPECT_EQ(read_file(folder_ / "all/results.csv"), read_file(folder_ / "parts/results.csv"));
  EXPECT_THROW(collect_shards({folder_ / "parts"}, folder_ / "parts/inner"), InputError);
}

TEST_F(Runner, RefusesToCollectShardsOfDifferentRuns) {
  const char* text =
      R"({{"name": "e", "sweep": {{"a": [1, 2, 3]}}, "steps": [{{"name": "s", "tool": "sh", "run": ["-c", "exit {}"]}}]}})";
  EXPECT_TRUE(holds(collect_refusal(), "no such folder"));
  run_shard(read_experiment(write(fmt::format(fmt::runtime(text), 0))), 1, 2);
  EXPECT_TRUE(holds(collect_refusal(), "are missing: 2"));
  run_shard(read_experiment(write(fmt::format(fmt::runtime(text), 1))), 2, 2);
  EXPECT_TRUE(holds(collect_refusal(), "\"experiment\" differs"));
  EXPECT_EQ(run_shard(read_experiment(write(fmt::format(fmt::runtime(text), 0))), 2, 2).done, 1);
  EXPECT_EQ(collect_refusal(), "accepted");
  std::filesystem::remove(folder_ / "parts/items/2.json");
  EXPECT_TRUE(holds(collect_refusal(), "2.json"));
}

TEST_F(Runner, SaysWhatIsWrongWithChecksAndLimits) {
  const std::string rest = R"("steps": [{"name": "s", "run": ["x"]}], "columns": {"mean": "s.m"}, )";
  EXPECT_TRUE(
      holds(refusal("{\"name\": \"e\", " + rest + R"("checks": {"meen": {"equals": 1}}})"), "did you mean mean?"));
  EXPECT_TRUE(holds(refusal("{\"name\": \"e\", " + rest + R"("checks": {"mean": {}}})"), "must have one of"));
  EXPECT_TRUE(
      holds(refusal("{\"name\": \"e\", " + rest + R"("checks": {"mean": {"most": "1"}}})"), "must be a number"));
  EXPECT_TRUE(holds(refusal("{\"name\": \"e\", " + rest + R"("limits": {"seconds": 0}})"), "above 0"));
  EXPECT_EQ(refusal("{\"name\": \"e\", " + rest + R"("checks": {"mean": {"most": 1}}, "limits": {"seconds": 9}})"),
            "accepted");
}

TEST(Outcomes, AProgramThatLacksMemoryIsKnownByItsWords) {
  try {
    require_memory(1e18, "encoding");
    FAIL();
  } catch (const Error& error) {
    EXPECT_TRUE(tells_of_memory(error.what())) << error.what();
  }
  EXPECT_FALSE(tells_of_memory("error: the mesh is not closed"));
}

TEST_F(Runner, ComparesNumbersByToleranceAndLeavesTimesOut) {
  const auto results = [](double mean, double ms, const char* status) {
    return OrderedJson{
        {"rows",
         {{{"key", "a"}, {"status", status}, {"columns", {{"mean", mean}, {"encode_ms", ms}, {"closed", true}}}}}}};
  };
  EXPECT_TRUE(compare_results(results(1, 5, "done"), results(1.01, 50, "done"), 0.02).empty());
  EXPECT_EQ(compare_results(results(1, 5, "done"), results(1.1, 5, "done"), 0.02).size(), 1u);
  EXPECT_EQ(compare_results(results(1, 5, "done"), results(1, 5, "failed"), 0.02).size(), 1u);
  EXPECT_EQ(compare_results(results(1, 5, "done"), OrderedJson{{"rows", OrderedJson::array()}}, 0.02).size(), 1u);
}

TEST(Processes, EndWithTheOneThatStartedThem) {
  const ScratchFolder folder;
  const std::string file = folder / "pid";
  const ::pid_t runner = ::fork();
  if (runner == 0) {
    run_process("/bin/sh", {"-c", "echo $$ > " + file + "; exec sleep 100"}, {}, folder / "errors.txt");
    ::_exit(0);
  }
  ::pid_t program = 0;
  for (int i = 0; i < 500 && program == 0; ++i) {
    std::ifstream(file) >> program;
    ::usleep(10000);
  }
  ASSERT_GT(program, 0);
  ::kill(runner, SIGKILL);
  ::waitpid(runner, nullptr, 0);
  const auto is_running = [&] {  // one that nobody has waited for yet is none
    std::ifstream stat("/proc/" + std::to_string(program) + "/stat");
    std::string number, name, state;
    return (stat >> number >> name >> state) && state != "Z" && state != "X";
  };
  for (int i = 0; i < 500 && is_running(); ++i) ::usleep(10000);
  EXPECT_FALSE(is_running());
}

TEST(Processes, ThatCannotBeStartedSayWhy) {
  const ScratchFolder folder;
  try {
    run_process("/no/such/program", {}, {}, folder / "errors.txt");
    FAIL();
  } catch (const IoError& error) {
    EXPECT_EQ(std::string(error.what()), "/no/such/program cannot be started: No such file or directory");
  }
  EXPECT_EQ(run_process("false", {}, {}, folder / "errors.txt").exit_code, 1);
}

TEST(ExperimentFiles, EveryCommittedExperimentCanBePlannedAndHasKnownCommands) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(SKELETEX_SOURCE_DIR "/configs/experiments")) {
    SCOPED_TRACE(entry.path().string());
    for (const bool is_quick : {false, true}) {
      const Experiment experiment =
          read_experiment(entry.path(), {.settings = {}, .is_quick = is_quick, .only = {}, .models = {}});
      EXPECT_EQ(experiment.name, entry.path().stem());
      for (const Item& item : plan_items(experiment))
        for (const Step& step : experiment.steps)
          EXPECT_NO_THROW(fill_arguments(experiment, item, step.run,
                                         {{"work", "w"}, {"out", "o"}, {"view", "v"}, {"config", "c"}}));
    }
    ++count;
  }
  EXPECT_GT(count, 0);
  for (const std::filesystem::path& file : experiment_files(SKELETEX_SOURCE_DIR "/configs/paper.json"))
    EXPECT_TRUE(std::filesystem::exists(file)) << file;
}

}  // namespace
}  // namespace skeletex
