/// \file xml_text.h
/// Text as it may stand in XML.
#pragma once
#include <string>
#include <string_view>

namespace tessera {

/// The characters that mean something in XML as entities, control characters as spaces.
inline std::string xml_text(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
  }
  return out;
}

}  // namespace tessera
