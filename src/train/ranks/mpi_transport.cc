// SPDX-License-Identifier: Apache-2.0
// The only file that knows MPI: a separate plugin, libtilegrad_mpi.so, so that neither the
// program nor the Python module needs MPI to start.
// Without the C++ bindings of MPI 2, which would need another library.
#define OMPI_SKIP_MPICXX 1
#define MPICH_SKIP_MPICXX 1
#include <mpi.h>

#include <cstdlib>
#include <mutex>
#include <string>
#include <vector>

#include "train/ranks/transport.h"

namespace tilegrad::train {
namespace {

constexpr int kNumbers = 4096;

// MPI guarantees tags up to 32767.
int TagOf(const Address& address) {
  static_assert((static_cast<int>(MessageKind::kTotal) + 1) * kNumbers <= 32767);
  return static_cast<int>(address.kind) * kNumbers + address.number;
}

class MpiTransport : public Transport {
 public:
  MpiTransport() {
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &size_);
    char name[MPI_MAX_PROCESSOR_NAME + 1] = {};
    int length = 0;
    MPI_Get_processor_name(name, &length);
    host_.assign(name, static_cast<std::size_t>(length));
  }
  ~MpiTransport() override { MPI_Finalize(); }

  int rank() const override { return rank_; }
  int size() const override { return size_; }
  const char* host() const override { return host_.c_str(); }

  Ticket Send(const Address& to, std::span<const std::byte> data) override {
    const std::scoped_lock lock(mutex_);
    const std::size_t slot = FreeSlot();
    MPI_Isend(data.data(), static_cast<int>(data.size()), MPI_BYTE, to.peer, TagOf(to),
              MPI_COMM_WORLD, &requests_[slot]);
    return static_cast<Ticket>(slot);
  }
  Ticket Receive(const Address& from, std::span<std::byte> data) override {
    const std::scoped_lock lock(mutex_);
    const std::size_t slot = FreeSlot();
    MPI_Irecv(data.data(), static_cast<int>(data.size()), MPI_BYTE, from.peer, TagOf(from),
              MPI_COMM_WORLD, &requests_[slot]);
    return static_cast<Ticket>(slot);
  }
  bool Done(Ticket ticket) override {
    const std::scoped_lock lock(mutex_);
    const auto slot = static_cast<std::size_t>(ticket);
    int done = 0;
    MPI_Test(&requests_[slot], &done, MPI_STATUS_IGNORE);
    if (done != 0) free_.push_back(slot);
    return done != 0;
  }
  [[noreturn]] void Abort(int code) override {
    MPI_Abort(MPI_COMM_WORLD, code);
    std::_Exit(code);
  }

 private:
  std::size_t FreeSlot() {
    if (free_.empty()) {
      free_.push_back(requests_.size());
      requests_.push_back(MPI_REQUEST_NULL);
    }
    const std::size_t slot = free_.back();
    free_.pop_back();
    return slot;
  }

  int rank_ = 0, size_ = 1;
  std::string host_;
  std::mutex mutex_;  // one thread at a time speaks to MPI: MPI_THREAD_SERIALIZED
  std::vector<MPI_Request> requests_;
  std::vector<std::size_t> free_;
};

}  // namespace
}  // namespace tilegrad::train

extern "C" tilegrad::train::Transport* TilegradConnectRanks(const char** error) {
  int provided = 0;
  if (MPI_Init_thread(nullptr, nullptr, MPI_THREAD_SERIALIZED, &provided) != MPI_SUCCESS) {
    *error = "MPI_Init_thread failed";
    return nullptr;
  }
  if (provided < MPI_THREAD_SERIALIZED) {
    *error = "this MPI allows calls from one thread only; tilegrad needs MPI_THREAD_SERIALIZED";
    return nullptr;
  }
  return new tilegrad::train::MpiTransport;
}
