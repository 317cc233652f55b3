#include "stream/meshes/corner_file.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

#include <fcntl.h>
#include <unistd.h>

#include "octree/error.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::size_t kBatchFaces = 65536;

void transfer(int fd, bool write, void* data, std::uint64_t bytes, std::uint64_t offset,
              const std::filesystem::path& folder) {
  auto* at = static_cast<char*>(data);
  while (bytes > 0) {
    const ssize_t done = write ? ::pwrite(fd, at, bytes, static_cast<off_t>(offset))
                               : ::pread(fd, at, bytes, static_cast<off_t>(offset));
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) {
      const std::string reason = done < 0 ? std::strerror(errno) : "it ends early";
      throw ResourceError("render: the temporary file in " + folder.string() + " fails at byte " +
                          std::to_string(offset) + " (" + reason +
                          "); free some space, or name another folder with --temp");
    }
    at += done;
    bytes -= static_cast<std::uint64_t>(done);
    offset += static_cast<std::uint64_t>(done);
  }
}

}  // namespace

CornerFile::CornerFile(const std::filesystem::path& folder) : folder_(folder.empty() ? "." : folder) {
  std::string name = (folder_ / ".tessera-render-XXXXXX").string();
  fd_ = ::mkstemp(name.data());
  if (fd_ < 0) {
    throw ResourceError("render: cannot create a temporary file in " + folder_.string() + " (" +
                        std::strerror(errno) + "); name another folder with --temp");
  }
  ::unlink(name.c_str());
}

CornerFile::~CornerFile() {
  if (fd_ >= 0) ::close(fd_);
}

void CornerFile::build(const std::filesystem::path& mesh, std::uint64_t vertices, const Double3& origin,
                       std::uint64_t memory_bytes) {
  const std::uint64_t per_pass = std::max<std::uint64_t>(memory_bytes / sizeof(Corner), 1u << 16);
  std::vector<Corner> range(static_cast<std::size_t>(std::min(per_pass, vertices)));
  std::vector<Corner> corners;
  for (std::uint64_t begin = 0; begin < vertices; begin += per_pass) {
    const std::uint64_t end = std::min(vertices, begin + per_pass);
    std::uint64_t next = 0;
    const auto reader = open_mesh_file(mesh);
    reader->read_vertices([&](std::span<const Double3> positions, std::span<const std::uint32_t> rgba) {
      throw_if_stopped();
      for (std::size_t i = 0; i < positions.size(); ++i, ++next) {
        if (next < begin || next >= end) continue;
        const Double3& p = positions[i];
        range[static_cast<std::size_t>(next - begin)] = {
            static_cast<float>(p[0] - origin[0]), static_cast<float>(p[1] - origin[1]),
            static_cast<float>(p[2] - origin[2]), rgba.empty() ? 0 : rgba[i]};
      }
    });
    std::uint64_t face = 0;
    reader->read_faces([&](std::span<const MeshFace> all) {
      for (std::size_t from = 0; from < all.size(); from += kBatchFaces) {
        throw_if_stopped();
        const auto batch = all.subspan(from, std::min(kBatchFaces, all.size() - from));
        corners.resize(3 * batch.size());
        const std::uint64_t offset = face * 3 * sizeof(Corner);
        if (begin > 0) transfer(fd_, false, corners.data(), corners.size() * sizeof(Corner), offset, folder_);
        for (std::size_t i = 0; i < batch.size(); ++i) {
          for (std::size_t c = 0; c < 3; ++c) {
            const std::uint64_t v = batch[i][c];
            if (v >= begin && v < end) corners[3 * i + c] = range[static_cast<std::size_t>(v - begin)];
          }
        }
        transfer(fd_, true, corners.data(), corners.size() * sizeof(Corner), offset, folder_);
        face += batch.size();
      }
    });
    faces_ = face;
  }
}

void CornerFile::read(const std::function<void(std::span<const Corner>)>& sink) const {
  std::vector<Corner> corners;
  for (std::uint64_t face = 0; face < faces_; face += kBatchFaces) {
    throw_if_stopped();
    corners.resize(3 * static_cast<std::size_t>(std::min<std::uint64_t>(kBatchFaces, faces_ - face)));
    const std::uint64_t bytes = corners.size() * sizeof(Corner);
    const std::uint64_t offset = face * 3 * sizeof(Corner);
    transfer(fd_, false, corners.data(), bytes, offset, folder_);
    ::posix_fadvise(fd_, static_cast<off_t>(offset), static_cast<off_t>(bytes), POSIX_FADV_DONTNEED);
    sink(corners);
  }
}

}  // namespace tessera
