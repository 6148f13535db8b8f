// SPDX-License-Identifier: Apache-2.0
// Serves the live page of a run (train/report/live_page.h) to this machine, and to it alone.
#pragma once

#include <memory>
#include <string>

#include "cli/command.h"
#include "tilegrad/status.h"
#include "train/report/live_page.h"

namespace tilegrad::cli {

// --live, --live=PORT.
struct LiveOption {
  std::string port;  // empty: not asked for; "any", or a number
};
void AddLiveOption(Command* command, LiveOption* option);

// Listens on 127.0.0.1 during its lifetime, on a thread of its own. Requests that name another
// host are refused, as a page of a stranger could send them (DNS rebinding).
class LiveServer {
 public:
  // port: of that number, an error if it is taken; 0: kLivePort, or any that is free. Says the
  // address on the terminal.
  static Result<LiveServer> Start(train::LiveSource source, int port);
  ~LiveServer();
  LiveServer(LiveServer&&) noexcept;
  LiveServer& operator=(LiveServer&&) noexcept;

  const std::string& address() const;  // "http://127.0.0.1:8642/"

 private:
  struct Impl;
  explicit LiveServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// Of --live: a server, or none if it was not asked for.
Result<std::unique_ptr<LiveServer>> StartLive(const LiveOption& option, train::LiveSource source);

}  // namespace tilegrad::cli
