#include "stream/page/data_block.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "stream/page/html.h"

namespace tessera {
namespace {

constexpr int kLevel = 5;                                // beyond, twice the time saves a hundredth
constexpr std::size_t kOutBytes = std::size_t{3} << 15;  // whole groups of base64

}  // namespace

struct DataBlock::Packer {
  z_stream stream{};
  std::vector<unsigned char> out = std::vector<unsigned char>(kOutBytes);
};

DataBlock::DataBlock(OutputFile& page, const std::string& id)
    : page_(page), packer_(std::make_unique<Packer>()) {
  if (deflateInit(&packer_->stream, kLevel) != Z_OK) throw std::runtime_error("zlib does not start");
  packer_->stream.next_out = packer_->out.data();
  packer_->stream.avail_out = static_cast<uInt>(kOutBytes);
  page_.append(fmt::format("<script type=\"application/octet-stream\" id=\"{}\">", html::escape(id)));
}

DataBlock::~DataBlock() {
  deflateEnd(&packer_->stream);
}

void DataBlock::add(const void* data, std::size_t bytes) {
  z_stream& z = packer_->stream;
  const auto* at = static_cast<const unsigned char*>(data);
  while (bytes > 0) {
    const std::size_t part = std::min<std::size_t>(bytes, std::size_t{1} << 30);
    z.next_in = const_cast<unsigned char*>(at);  // zlib's own words for a constant
    z.avail_in = static_cast<uInt>(part);
    while (z.avail_in > 0) {
      deflate(&z, Z_NO_FLUSH);
      if (z.avail_out > 0) continue;
      page_.append(html::base64({reinterpret_cast<const char*>(packer_->out.data()), kOutBytes}));
      z.next_out = packer_->out.data();
      z.avail_out = static_cast<uInt>(kOutBytes);
    }
    at += part;
    bytes -= part;
  }
}

void DataBlock::end() {
  z_stream& z = packer_->stream;
  for (int state = Z_OK; state != Z_STREAM_END;) {
    state = deflate(&z, Z_FINISH);
    page_.append(html::base64({reinterpret_cast<const char*>(packer_->out.data()), kOutBytes - z.avail_out}));
    z.next_out = packer_->out.data();
    z.avail_out = static_cast<uInt>(kOutBytes);
  }
  page_.append("</script>\n");
}

}  // namespace tessera
