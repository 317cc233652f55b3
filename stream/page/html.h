/// \file html.h
/// Pieces of a page: text made safe, tables, bars, histograms, pictures. Nothing refers to anything outside of the page.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tessera::html {

/// Text as it may stand between tags and in quoted attributes. Names of files are hostile: markup, control characters and
/// marks that turn the direction of writing lose their meaning.
std::string escape(std::string_view text);

std::string base64(std::string_view bytes);
constexpr std::size_t base64_size(std::size_t bytes) {
  return (bytes + 2) / 3 * 4;
}
/// The same behind a text.
void append_base64(std::string& text, std::string_view bytes);

/// Two columns; names are escaped here, values are HTML already.
std::string table(const std::vector<std::pair<std::string, std::string>>& rows);

struct Bar {
  std::string name, value;  ///< plain text
  double share = 0.0;       ///< of the longest, 0..1
};
std::string bars(const std::string& title, const std::vector<Bar>& rows);

/// A line across a histogram.
struct Mark {
  double at = 0.0;  ///< in bins from the left
  std::string label;
};
struct Histogram {
  std::string title;
  std::vector<double> counts;
  std::vector<std::string> edges;  ///< counts.size() + 1 labels below; empty ones are left out
  std::vector<Mark> marks;
};
/// A drawing, and the shares as a table for those who cannot see it.
std::string histogram(const Histogram& h);

/// \param png  the bytes of the file
std::string picture(std::string_view png, const std::string& alternative, const std::string& caption);

/// A figure in large letters over what it is.
std::string tile(const std::string& value, const std::string& what);

/// What every page of `generator` begins with, to the byte.
std::string begin(const std::string& generator);
/// begin(), the title, the styles, and a policy that forbids to load anything, up to the body.
/// \param scripts  whether those in the page may run
std::string head(const std::string& generator, const std::string& title, bool scripts);

/// <section> with a heading.
std::string section(const std::string& id, const std::string& title, std::string_view body);
/// What stands before its body and behind it.
std::string section_begin(const std::string& id, const std::string& title);
inline constexpr std::string_view kSectionEnd = "</section>\n";
std::string paragraph(const std::string& text, const std::string& css_class = "");

}  // namespace tessera::html
