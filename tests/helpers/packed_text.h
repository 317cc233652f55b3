/// \file packed_text.h
/// Text as gzip and zstd pack it.
#pragma once
#include <zlib.h>
#include <zstd.h>

#include <stdexcept>
#include <string>

namespace tessera::test {

/// One member.
inline std::string gzip_of(const std::string& text) {
  z_stream stream{};
  if (deflateInit2(&stream, 6, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::runtime_error("zlib");
  std::string packed(deflateBound(&stream, text.size()) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  const bool done = deflate(&stream, Z_FINISH) == Z_STREAM_END;
  packed.resize(packed.size() - stream.avail_out);
  deflateEnd(&stream);
  if (!done) throw std::runtime_error("zlib");
  return packed;
}

/// One frame, with a checksum. \param window_log  of the frame, 0 = as the level has it
inline std::string zstd_of(const std::string& text, int window_log = 0) {
  ZSTD_CCtx* context = ZSTD_createCCtx();
  ZSTD_CCtx_setParameter(context, ZSTD_c_checksumFlag, 1);
  ZSTD_CCtx_setParameter(context, ZSTD_c_contentSizeFlag, 0);
  if (window_log > 0) ZSTD_CCtx_setParameter(context, ZSTD_c_windowLog, window_log);
  std::string packed(ZSTD_compressBound(text.size()) + 64, '\0');
  ZSTD_inBuffer in{text.data(), text.size(), 0};
  ZSTD_outBuffer out{packed.data(), packed.size(), 0};
  const bool done = ZSTD_compressStream2(context, &out, &in, ZSTD_e_end) == 0;  // streamed: no size, a window
  ZSTD_freeCCtx(context);
  if (!done) throw std::runtime_error("zstd");
  packed.resize(out.pos);
  return packed;
}

}  // namespace tessera::test
