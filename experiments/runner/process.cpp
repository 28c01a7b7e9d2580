// SPDX-License-Identifier: MIT
#include "process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>

#include "skeletex/io/read_file.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr std::size_t kErrorBytes = 4000;

/// What a child does between fork and exec, where only calls that are safe in signal handlers may be made. It ends with
/// its parent, also where that was killed.
/// \param failure  receives errno where the program cannot be started
[[noreturn]] void become(char* const* argv, char* const* variables, const char* error_file, ::pid_t parent,
                         const ProcessLimits& limits, int failure) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(127);
  if (limits.seconds > 0) ::setpgid(0, 0);  // so that all of it can be ended
  if (limits.memory_mb > 0) {
    const auto bytes = static_cast<rlim_t>(limits.memory_mb * (1 << 20));
    const rlimit most{bytes, bytes};
    ::setrlimit(RLIMIT_AS, &most);
  }
  const int in = ::open("/dev/null", O_RDONLY), out = ::open("/dev/null", O_WRONLY),
            errors = ::open(error_file, O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (in >= 0 && out >= 0 && errors >= 0 && ::dup2(in, STDIN_FILENO) >= 0 && ::dup2(out, STDOUT_FILENO) >= 0 &&
      ::dup2(errors, STDERR_FILENO) >= 0)
    ::execvpe(argv[0], argv, variables);
  const int code = errno;
  [[maybe_unused]] const ::ssize_t written = ::write(failure, &code, sizeof code);
  ::_exit(127);
}

/// Starts a program.
/// \throw IoError when it cannot be started
::pid_t start(char* const* argv, char* const* variables, const std::string& error_file, const ProcessLimits& limits) {
  int channel[2];  // closed by exec, or the errno of what failed before
  if (::pipe2(channel, O_CLOEXEC) != 0)
    throw IoError(fmt::format("{} cannot be started: {}", argv[0], std::strerror(errno)));
  const ::pid_t parent = ::getpid(), child = ::fork();
  if (child == 0) become(argv, variables, error_file.c_str(), parent, limits, channel[1]);
  int code = child < 0 ? errno : 0;
  ::close(channel[1]);
  if (child > 0 && ::read(channel[0], &code, sizeof code) == sizeof code) ::waitpid(child, nullptr, 0);
  ::close(channel[0]);
  if (code != 0) throw IoError(fmt::format("{} cannot be started: {}", argv[0], std::strerror(code)));
  return child;
}

/// Waits until a child ends, at most for some seconds.
/// \return whether it has ended
bool ends_within(::pid_t child, double seconds) {
  const int handle = static_cast<int>(::syscall(SYS_pidfd_open, child, 0));
  if (handle < 0) throw IoError(fmt::format("a process cannot be watched: {}", std::strerror(errno)));
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  int ended = 0;
  do {
    const double left = std::chrono::duration<double>(end - std::chrono::steady_clock::now()).count();
    pollfd watched{handle, POLLIN, 0};
    ended = ::poll(&watched, 1, static_cast<int>(std::clamp(left * 1000, 0.0, 1e9)));
  } while (ended < 0 && errno == EINTR);
  ::close(handle);
  return ended > 0;
}

}  // namespace

ProcessResult run_process(const std::string& program, const std::vector<std::string>& arguments,
                          const std::map<std::string, std::string>& environment,
                          const std::filesystem::path& error_file, const ProcessLimits& limits) {
  std::vector<std::string> texts;
  for (char** entry = ::environ; *entry; ++entry) {
    const std::string text = *entry;
    if (!environment.contains(text.substr(0, text.find('=')))) texts.push_back(text);
  }
  for (const auto& [name, value] : environment) texts.push_back(name + "=" + value);
  std::vector<char*> variables, argv{const_cast<char*>(program.c_str())};
  for (std::string& text : texts) variables.push_back(text.data());
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  variables.push_back(nullptr);
  argv.push_back(nullptr);

  const auto begin = std::chrono::steady_clock::now();
  const ::pid_t child = start(argv.data(), variables.data(), error_file.string(), limits);
  ProcessResult result;
  if (limits.seconds > 0 && !ends_within(child, limits.seconds)) {
    result.is_out_of_time = true;
    if (::kill(-child, SIGKILL) != 0) ::kill(child, SIGKILL);
  }
  int status = 0;
  rusage usage{};
  while (::wait4(child, &status, 0, &usage) < 0 && errno == EINTR) {
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.peak_memory_mb = static_cast<double>(usage.ru_maxrss) / 1024;
  result.errors = read_file(error_file);
  if (result.errors.size() > kErrorBytes) result.errors = result.errors.substr(result.errors.size() - kErrorBytes);
  while (!result.errors.empty() && result.errors.back() == '\n') result.errors.pop_back();
  return result;
}

}  // namespace skeletex
