/// \file jpeg_leave.h
/// libjpeg leaves by longjmp where it fails, which must not cross frames with destructors: this is where it goes to.
#pragma once
#include <csetjmp>
#include <cstdio>

#include <jpeglib.h>

namespace tessera {

/// Use: `jpeg.err = leave.manager(); if (setjmp(leave.to) != 0) { ...; return false; }` in a frame of plain data. Says nothing
/// on stderr. Outlives the libjpeg struct.
struct JpegLeave {
  jpeg_error_mgr errors;
  std::jmp_buf to;

  jpeg_error_mgr* manager() {
    jpeg_std_error(&errors);
    errors.error_exit = [](j_common_ptr jpeg) {
      std::longjmp(reinterpret_cast<JpegLeave*>(jpeg->err)->to, 1);
    };
    errors.output_message = [](j_common_ptr) {};
    return &errors;
  }
};

}  // namespace tessera
