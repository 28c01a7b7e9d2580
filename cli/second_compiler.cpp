// SPDX-License-Identifier: MIT
#include "second_compiler.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>

namespace skeletex::cli {

SecondCompiler::SecondCompiler(const std::function<void(const std::function<bool()>&)>& compile) {
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) return;  // then there is one compiler
  process_ = fork();
  if (process_ != 0) {
    close(ends[0]);
    if (process_ < 0)
      close(ends[1]);
    else
      other_ = ends[1];
    return;
  }
  close(ends[1]);
  char order = 0;
  if (read(ends[0], &order, 1) != 1) _exit(0);
  unsetenv("POCL_AFFINITY");  // not on the processor where the first process compiles
  // Nobody shall wait for this process to close what it has inherited.
  const int nowhere = open("/dev/null", O_RDWR);
  for (const int stream : {0, 1, 2}) dup2(nowhere, stream);
  const auto is_wanted = [&] {
    pollfd other_end{ends[0], POLLIN, 0};
    return poll(&other_end, 1, 0) == 0;
  };
  try {
    compile(is_wanted);
  } catch (...) {
    // The first process meets the same, and says so.
  }
  _exit(0);
}

SecondCompiler::~SecondCompiler() {
  if (other_ < 0) return;
  close(other_);
  waitpid(process_, nullptr, 0);
}

void SecondCompiler::start() {
  const char order = 1;
  if (other_ >= 0) static_cast<void>(send(other_, &order, 1, MSG_NOSIGNAL));
}

}  // namespace skeletex::cli
