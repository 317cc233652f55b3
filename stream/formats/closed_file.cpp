#include "stream/formats/closed_file.h"

#include <string>

#include "octree/error.h"

namespace tessera {

ReadFile ClosedFile::open() const {
  ReadFile file = packed_.empty() ? ReadFile(path_) : ReadFile::unpacked(path_, size_);
  if (file.size() != size_) {
    throw InputError(path_.string() + ": had " + std::to_string(size_) + " bytes and now has " +
                     std::to_string(file.size()) + "; inputs must not change while they are read");
  }
  if (file.modified() != modified_)
    throw InputError(path_.string() +
                     ": was written to since it was read first; inputs must not change while they are read");
  return file;
}

}  // namespace tessera
