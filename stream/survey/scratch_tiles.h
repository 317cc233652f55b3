/// \file scratch_tiles.h
/// Tiles of a sparse raster: those used last in memory, the others in a scratch file.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

namespace tessera {

/// Column and row of a tile.
struct TileKey {
  std::int32_t u = 0, v = 0;
  bool operator==(const TileKey&) const = default;
  bool operator<(const TileKey& o) const { return v != o.v ? v < o.v : u < o.u; }
};

class ScratchTiles {
 public:
  /// \throws ResourceError when the file cannot be made
  ScratchTiles(std::filesystem::path path, std::size_t tile_bytes);
  ~ScratchTiles();
  ScratchTiles(const ScratchTiles&) = delete;
  ScratchTiles& operator=(const ScratchTiles&) = delete;

  /// So many tiles are held in memory. \pre >= 1, flush() was called or nothing used
  void hold(std::size_t tiles) { most_ = tiles; }
  /// The tile, to be changed until the next call. \param blank  fills one that is new
  char* change(TileKey key, const std::function<void(char*)>& blank);
  /// The tile until the next call, null where there is none.
  const char* find(TileKey key);
  /// Writes what was changed, and holds no tile any more.
  void flush();

  /// A tile anew; any thread, beside put() and read() of other threads. \pre none is held
  void put(TileKey key, const char* from);
  /// False where there is none; any thread. \pre none is held, no put() at the same time
  bool read(TileKey key, char* to) const;
  /// Ascending. \pre none is held
  std::vector<TileKey> keys() const;

 private:
  struct Hash {
    std::size_t operator()(const TileKey& k) const {
      return (static_cast<std::uint64_t>(static_cast<std::uint32_t>(k.u)) << 32 |
              static_cast<std::uint32_t>(k.v)) *
                 0x9e3779b97f4a7c15ull >>
             16;
    }
  };
  struct Frame {
    TileKey key;
    std::uint64_t used = 0;
    bool changed = false;
    std::unique_ptr<char[]> bytes;
  };
  Frame& frame_for(TileKey key);
  void write(const Frame& frame);
  void read_slot(std::size_t slot, char* to) const;

  std::filesystem::path path_;
  std::size_t bytes_;
  int fd_ = -1;
  std::size_t most_ = 1;
  std::uint64_t clock_ = 0;
  std::vector<Frame> frames_;
  std::unordered_map<TileKey, std::size_t, Hash> held_;   ///< index of its frame
  std::unordered_map<TileKey, std::size_t, Hash> slots_;  ///< place in the file
  std::mutex mutex_;                                      ///< of slots_, in put()
};

}  // namespace tessera
