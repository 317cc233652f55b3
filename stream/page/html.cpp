#include "stream/page/html.h"

#include <algorithm>

#include <fmt/format.h>

#include "stream/page/page_style.h"
#include "stream/runtime/numbers.h"

namespace tessera::html {
namespace {

/// Embeddings, overrides and isolates of the direction of writing, as UTF-8.
bool is_bidi_control(std::string_view three) {
  return three.size() == 3 && three[0] == '\xe2' &&
         ((three[1] == '\x80' && three[2] >= '\xaa' && three[2] <= '\xae') ||
          (three[1] == '\x81' && three[2] >= '\xa6' && three[2] <= '\xa9'));
}

}  // namespace

std::string escape(std::string_view text) {
  static constexpr const char* kUnknown = "\xef\xbf\xbd";  // U+FFFD
  std::string safe;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '&') {
      safe += "&amp;";
    } else if (c == '<') {
      safe += "&lt;";
    } else if (c == '>') {
      safe += "&gt;";
    } else if (c == '"') {
      safe += "&quot;";
    } else if (c == '\'') {
      safe += "&#39;";
    } else if (is_bidi_control(text.substr(i, 3))) {
      safe += kUnknown;
      i += 2;
    } else if ((static_cast<unsigned char>(c) < 0x20 && c != '\n') || c == 0x7f) {
      safe += kUnknown;
    } else {
      safe += c;
    }
  }
  return safe;
}

std::string base64(std::string_view bytes) {
  std::string text;
  append_base64(text, bytes);
  return text;
}

void append_base64(std::string& text, std::string_view bytes) {
  static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const std::size_t before = text.size();
  text.resize(before + base64_size(bytes.size()), '=');
  char* to = text.data() + before;
  const auto byte = [&](std::size_t i) { return std::uint32_t{static_cast<unsigned char>(bytes[i])}; };
  const auto digits = [&](std::uint32_t word, int count) {
    for (int k = 0; k < count; ++k) to[k] = kDigits[(word >> (18 - 6 * k)) & 63];
    to += 4;
  };
  std::size_t i = 0;
  for (; i + 3 <= bytes.size(); i += 3) digits(byte(i) << 16 | byte(i + 1) << 8 | byte(i + 2), 4);
  if (bytes.size() - i == 1) digits(byte(i) << 16, 2);
  if (bytes.size() - i == 2) digits(byte(i) << 16 | byte(i + 1) << 8, 3);
}

std::string table(const std::vector<std::pair<std::string, std::string>>& rows) {
  std::string text = "<table>\n";
  for (const auto& [name, value] : rows)
    text += fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td></tr>\n", escape(name), value);
  return text + "</table>\n";
}

std::string bars(const std::string& title, const std::vector<Bar>& rows) {
  std::string text = fmt::format("<table class=\"bars\">\n<caption>{}</caption>\n", escape(title));
  for (const Bar& row : rows)
    text += fmt::format(
        "<tr><th scope=\"row\">{}</th><td class=\"n\">{}</td><td class=\"bar\"><span "
        "style=\"width:{:.2f}%\"></span></td></tr>\n",
        escape(row.name), escape(row.value), 100.0 * std::clamp(row.share, 0.0, 1.0));
  return text + "</table>\n";
}

std::string histogram(const Histogram& h) {
  constexpr double kWidth = 640.0, kHeight = 190.0, kTop = 26.0, kBase = 160.0;
  double maximum = 0.0, all = 0.0;
  for (const double c : h.counts) maximum = std::max(maximum, c), all += c;
  if (!(all > 0.0)) return "";
  const double step = kWidth / static_cast<double>(h.counts.size());
  std::string svg = fmt::format(
      "<figure class=\"histogram\"><figcaption>{0}</figcaption>\n<svg viewBox=\"-8 0 {1} {2}\" role=\"img\" "
      "aria-label=\"{0}\">\n",
      escape(h.title), kWidth + 16.0, kHeight);
  for (std::size_t i = 0; i < h.counts.size(); ++i) {
    const double tall = (kBase - kTop) * h.counts[i] / maximum;
    if (tall > 0.0)
      svg += fmt::format("<rect x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\"/>\n",
                         step * static_cast<double>(i) + 0.5, kBase - tall, step - 1.0, tall);
  }
  svg += fmt::format("<line x1=\"0\" x2=\"{0}\" y1=\"{1}\" y2=\"{1}\"/>\n", kWidth, kBase);
  constexpr double kHalfLabel = 24.0;
  const auto anchor = [&](double x) {
    return x < kHalfLabel ? "start" : x > kWidth - kHalfLabel ? "end" : "middle";
  };
  for (std::size_t i = 0; i < h.edges.size(); ++i) {
    const double x = step * static_cast<double>(i);
    if (!h.edges[i].empty())
      svg += fmt::format("<text x=\"{:.2f}\" y=\"{}\" text-anchor=\"{}\">{}</text>\n", x, kBase + 20.0,
                         anchor(x), escape(h.edges[i]));
  }
  for (const Mark& mark : h.marks) {
    const double x = std::clamp(step * mark.at, 0.0, kWidth);
    svg += fmt::format(
        "<line class=\"mark\" x1=\"{0:.2f}\" x2=\"{0:.2f}\" y1=\"{1}\" y2=\"{2}\"/>"
        "<text class=\"mark\" x=\"{0:.2f}\" y=\"{3}\" text-anchor=\"{4}\">{5}</text>\n",
        x, kTop - 8.0, kBase, kTop - 12.0, x < kWidth / 2 ? "start" : "end", escape(mark.label));
  }
  svg += "</svg>\n<details><summary>as a table</summary><table>\n";
  for (std::size_t i = 0; i < h.counts.size(); ++i)
    svg += fmt::format("<tr><th scope=\"row\">{}</th><td>{} %</td></tr>\n",
                       escape(i < h.edges.size() && !h.edges[i].empty() ? "from " + h.edges[i]
                                                                        : "bin " + std::to_string(i + 1)),
                       number_text(100.0 * h.counts[i] / all));
  return svg + "</table></details></figure>\n";
}

std::string picture(std::string_view png, const std::string& alternative, const std::string& caption) {
  std::string text = fmt::format("<figure><img alt=\"{}\" src=\"data:image/png;base64,", escape(alternative));
  const std::string end = fmt::format("\"><figcaption>{}</figcaption></figure>\n", escape(caption));
  text.reserve(text.size() + base64_size(png.size()) + end.size());
  append_base64(text, png);
  text += end;
  return text;
}

std::string tile(const std::string& value, const std::string& what) {
  return fmt::format("<div class=\"tile\"><b>{}</b><span>{}</span></div>\n", escape(value), escape(what));
}

std::string begin(const std::string& generator) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"generator\" content=\"{}\">\n",
      generator);
}

std::string head(const std::string& generator, const std::string& title, bool scripts) {
  // Nothing is fetched, whatever should ever slip into the text.
  return begin(generator) +
         fmt::format(
             "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; "
             "style-src 'unsafe-inline'{}\">\n"
             "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
             "<meta name=\"color-scheme\" content=\"light dark\">\n"
             "<title>{}</title>\n<style>{}</style>\n</head>\n<body>\n",
             scripts ? "; script-src 'unsafe-inline'" : "", escape(title), kPageStyle);
}

std::string section_begin(const std::string& id, const std::string& title) {
  return fmt::format("<section id=\"{0}\" aria-labelledby=\"{0}-title\">\n<h2 id=\"{0}-title\">{1}</h2>\n",
                     id, escape(title));
}

std::string section(const std::string& id, const std::string& title, std::string_view body) {
  // Bodies hold pictures: they are copied once.
  std::string text = section_begin(id, title);
  text.reserve(text.size() + body.size() + kSectionEnd.size());
  return text.append(body).append(kSectionEnd);
}

std::string paragraph(const std::string& text, const std::string& css_class) {
  return css_class.empty() ? fmt::format("<p>{}</p>\n", escape(text))
                           : fmt::format("<p class=\"{}\">{}</p>\n", css_class, escape(text));
}

}  // namespace tessera::html
