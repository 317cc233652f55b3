/// \file data_block.h
/// Bytes of any number inside a page: deflated, in base64, as a <script> that no browser runs.
#pragma once
#include <cstddef>
#include <memory>
#include <string>

#include "stream/files/output_file.h"

namespace tessera {

class DataBlock {
 public:
  /// Begins the block in the page. \param id  of the element
  DataBlock(OutputFile& page, const std::string& id);
  ~DataBlock();
  DataBlock(const DataBlock&) = delete;
  DataBlock& operator=(const DataBlock&) = delete;

  /// \throws ResourceError when the disk is full
  void add(const void* data, std::size_t bytes);
  void end();

  static constexpr std::size_t kMemoryBytes = std::size_t{512} << 10;  ///< that a block holds

 private:
  struct Packer;
  OutputFile& page_;
  std::unique_ptr<Packer> packer_;
};

}  // namespace tessera
