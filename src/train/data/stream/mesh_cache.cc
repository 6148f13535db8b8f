// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/mesh_cache.h"

#include <condition_variable>
#include <deque>
#include <list>
#include <mutex>
#include <new>
#include <thread>

#include "base/free_memory.h"
#include "base/parallel.h"

namespace tilegrad::train {
namespace {

MeshSceneOptions SceneOptions(NormalSource normals) {
  MeshSceneOptions options;
  options.color_space = ColorSpace::kSrgb;
  options.normals = normals;
  options.filter = Filter::kBilinear;
  options.blend = false;
  return options;
}

template <class T>
std::size_t BytesOf(const std::vector<T>& values) {
  return values.capacity() * sizeof(T);
}

constexpr std::size_t kMuch = std::size_t{8} << 20;

}  // namespace

TexturedMesh::TexturedMesh(Mesh mesh, NormalSource normals)
    : mesh_(std::make_unique<Mesh>(std::move(mesh))),
      scene_(std::make_unique<MeshScene>(*mesh_, SceneOptions(normals))) {}

std::size_t TexturedMesh::bytes() const {
  const Mesh& m = *mesh_;
  std::size_t bytes = BytesOf(m.positions) + BytesOf(m.faces) + BytesOf(m.normals) +
                      BytesOf(m.colors) + BytesOf(m.corner_uvs) + BytesOf(m.corner_normals) +
                      BytesOf(m.corner_colors) + BytesOf(m.face_materials) + BytesOf(m.materials) +
                      scene().colors.values.size_bytes();
  for (const MeshTexture& texture : m.textures) bytes += texture.image.pixels.size();
  for (const Texture& texture : scene().textures) bytes += texture.texels.size_bytes();
  return bytes;
}

class MeshCache::State {
 public:
  State(std::size_t count, std::size_t limit, Read read)
      : limit_(limit), read_(std::move(read)), entries_(count) {}
  ~State() {
    {
      const std::scoped_lock lock(mutex_);
      closing_ = true;
    }
    changed_.notify_all();
    if (reader_.joinable()) reader_.join();
  }

  Result<Held> Get(std::size_t index) {
    std::unique_lock lock(mutex_);
    std::erase(expected_, index);
    return Get(index, lock);
  }

  void Expect(const std::vector<std::size_t>& indices) {
    const std::scoped_lock lock(mutex_);
    if (AllStay()) return;
    expected_.insert(expected_.end(), indices.begin(), indices.end());
    if (!reader_.joinable()) reader_ = std::thread([this] { ReadAhead(); });
    changed_.notify_all();
  }

  std::size_t size() const { return entries_.size(); }
  std::size_t bytes() const {
    const std::scoped_lock lock(mutex_);
    return bytes_;
  }
  bool full() const {
    const std::scoped_lock lock(mutex_);
    return full_;
  }

 private:
  bool AllStay() const { return !full_ && order_.size() == entries_.size(); }

  struct Entry {
    Held mesh;
    std::list<std::size_t>::iterator place;  // in order_, while the mesh is there
    bool reading = false;                    // by a thread
  };

  // No other thread reads the same while this one does, however it ends.
  class Reading {
   public:
    Reading(State& state, Entry& entry, std::unique_lock<std::mutex>& lock)
        : state_(state), entry_(entry), lock_(lock) {
      entry_.reading = true;
      lock_.unlock();
    }
    ~Reading() {
      if (!lock_.owns_lock()) lock_.lock();
      entry_.reading = false;
      state_.changed_.notify_all();
    }
    Reading(const Reading&) = delete;
    Reading& operator=(const Reading&) = delete;

   private:
    State& state_;
    Entry& entry_;
    std::unique_lock<std::mutex>& lock_;
  };

  Result<Held> Get(std::size_t index, std::unique_lock<std::mutex>& lock) {
    Entry& entry = entries_[index];
    changed_.wait(lock, [&] { return !entry.reading; });
    if (entry.mesh) {
      order_.splice(order_.end(), order_, entry.place);
      return entry.mesh;
    }
    const Reading reading(*this, entry, lock);
    TILEGRAD_ASSIGN(TexturedMesh mesh, read_(index));
    auto held = std::make_shared<const TexturedMesh>(std::move(mesh));
    lock.lock();
    Keep(index, held);
    // Meshes that left stay with the heap of the thread that read them, in time as much as is here.
    const bool much_left = left_ > limit_ / 16 + kMuch;
    if (much_left) left_ = 0;
    lock.unlock();
    if (much_left) ReturnFreeMemory();
    return Held(std::move(held));
  }

  void Keep(std::size_t index, const Held& mesh) {
    entries_[index].place = order_.insert(order_.end(), index);
    entries_[index].mesh = mesh;
    bytes_ += mesh->bytes();
    while (bytes_ > limit_) {
      full_ = true;
      Held& oldest = entries_[order_.front()].mesh;
      bytes_ -= oldest->bytes();
      left_ += oldest->bytes();
      oldest.reset();
      order_.pop_front();
    }
    if (AllStay()) read_ = nullptr;  // and the list of files that it holds
  }

  void ReadAhead() {
    ReserveThreadData();
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [this] { return closing_ || !expected_.empty(); });
      if (closing_) return;
      const std::size_t index = expected_.front();
      expected_.pop_front();
      // Whoever needs the mesh meets the error again.
      try {
        (void)Get(index, lock);
      } catch (const std::bad_alloc&) {
      }
    }
  }

  const std::size_t limit_;
  Read read_;                 // until all are there to stay
  mutable std::mutex mutex_;  // of all below
  std::condition_variable changed_;
  std::vector<Entry> entries_;
  std::list<std::size_t> order_;      // of those in memory, the least recently used first
  std::size_t bytes_ = 0, left_ = 0;  // in memory; gone since free memory was returned
  bool full_ = false, closing_ = false;
  std::deque<std::size_t> expected_;
  std::thread reader_;  // from the first expectation on
};

MeshCache::MeshCache(std::size_t count, std::size_t bytes, Read read)
    : state_(std::make_shared<State>(count, bytes, std::move(read))) {}

Result<MeshCache::Held> MeshCache::Get(std::size_t index) const { return state_->Get(index); }
void MeshCache::Expect(const std::vector<std::size_t>& indices) const { state_->Expect(indices); }
std::size_t MeshCache::size() const { return state_->size(); }
std::size_t MeshCache::bytes() const { return state_->bytes(); }
bool MeshCache::full() const { return state_->full(); }

}  // namespace tilegrad::train
