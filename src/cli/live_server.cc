// SPDX-License-Identifier: Apache-2.0
#include "cli/live_server.h"

#include <httplib.h>

#include <chrono>
#include <set>
#include <thread>

#include "base/error.h"
#include "cli/console.h"
#include "cli/option_words.h"

namespace tilegrad::cli {
namespace {

constexpr const char* kHost = "127.0.0.1";
constexpr int kLivePort = 8642;
constexpr int kThreads = 4;  // of answers: a browser opens several connections

constexpr const char* kJson = "application/json";

void AnswerError(const Status& status, httplib::Response* response) {
  response->status = status.code() == StatusCode::kNotFound ? 404 : 500;
  response->set_content(status.message(), "text/plain; charset=utf-8");
}

void Answer(const Result<std::string>& text, const char* type, httplib::Response* response) {
  if (!text.ok()) return AnswerError(text.status(), response);
  response->set_content(*text, type);
}

std::int64_t StepOf(const httplib::Request& request) {
  return WholeNumber(request.get_param_value("step")).value_or(-1);
}

}  // namespace

struct LiveServer::Impl {
  explicit Impl(train::LiveSource source) : run(std::move(source)) {}
  ~Impl() {
    server.stop();
    if (thread.joinable()) thread.join();
  }
  Status Bind(int port);
  void Route();

  train::LiveRun run;
  httplib::Server server;
  std::string address;
  std::set<std::string> hosts;  // by which a request may name this one
  std::thread thread;
};

Status LiveServer::Impl::Bind(int port) {
  int bound = port > 0 ? port : kLivePort;
  if (!server.bind_to_port(kHost, bound)) {
    if (port > 0) return IoError("--live: port {} of {} is taken; name another", port, kHost);
    bound = server.bind_to_any_port(kHost);
    if (bound <= 0) return IoError("--live: no port of {} is free", kHost);
  }
  address = fmt::format("http://{}:{}/", kHost, bound);
  hosts = {fmt::format("{}:{}", kHost, bound), fmt::format("localhost:{}", bound)};
  return {};
}

void LiveServer::Impl::Route() {
  using httplib::Request, httplib::Response;
  server.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };
  server.set_pre_routing_handler([this](const Request& request, Response& response) {
    if (hosts.count(request.get_header_value("Host")))
      return httplib::Server::HandlerResponse::Unhandled;
    response.status = 403;
    return httplib::Server::HandlerResponse::Handled;
  });
  server.Get("/", [](const Request&, Response& response) {
    Answer(train::LivePage(), "text/html; charset=utf-8", &response);
  });
  server.Get("/state",
             [this](const Request&, Response& response) { Answer(run.State(), kJson, &response); });
  server.Get("/mesh", [this](const Request& request, Response& response) {
    Answer(run.Mesh(StepOf(request)), kJson, &response);
  });
  server.Get("/picture", [this](const Request& request, Response& response) {
    const auto png = run.Picture(StepOf(request));
    if (!png.ok()) return AnswerError(png.status(), &response);
    response.set_content(reinterpret_cast<const char*>(png->data()), png->size(), "image/png");
  });
}

LiveServer::LiveServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LiveServer::~LiveServer() = default;
LiveServer::LiveServer(LiveServer&&) noexcept = default;
LiveServer& LiveServer::operator=(LiveServer&&) noexcept = default;
const std::string& LiveServer::address() const { return impl_->address; }

Result<LiveServer> LiveServer::Start(train::LiveSource source, int port) {
  auto impl = std::make_unique<Impl>(std::move(source));
  impl->Route();
  TILEGRAD_TRY(impl->Bind(port));
  impl->thread = std::thread([server = &impl->server] { server->listen_after_bind(); });
  // Before it listens, stop() would be forgotten, and the thread never end.
  for (int i = 0; i < 5000 && !impl->server.is_running(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  PrintNote("live view: {}\n", impl->address);
  return LiveServer(std::move(impl));
}

void AddLiveOption(Command* command, LiveOption* option) {
  command->Add("--live", FlagWord{&option->port, "any"},
               "serve a page for this machine that shows curves, pictures and the mesh as they "
               "form; --live=PORT: at that port");
}

Result<std::unique_ptr<LiveServer>> StartLive(const LiveOption& option, train::LiveSource source) {
  if (option.port.empty()) return std::unique_ptr<LiveServer>();
  const bool any = option.port == "any";
  const std::int64_t port = any ? 0 : WholeNumber(option.port).value_or(-1);
  if (!any && (port < 1 || port > 65535))
    return InvalidArgument("--live={}: a port is a number from 1 to 65535", option.port);
  TILEGRAD_ASSIGN(LiveServer server, LiveServer::Start(std::move(source), static_cast<int>(port)));
  return std::make_unique<LiveServer>(std::move(server));
}

}  // namespace tilegrad::cli
