/// \file html_fault.h
/// Whether a page that Tessera wrote is well formed.
#pragma once
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace tessera::test {

/// The first fault of its tags: not closed, closed in another order, an attribute without quotes; empty if there is none.
inline std::string html_fault(const std::string& page) {
  static const std::regex kTag(R"re(<(/?)([a-zA-Z0-9]+)((?:\s+[a-zA-Z0-9:-]+(?:="[^"<>]*")?)*)\s*(/?)>)re");
  static const std::set<std::string> kVoid = {"meta", "img", "input", "br"};
  std::vector<std::string> open;
  std::size_t at = page.find('>') + 1;  // behind the doctype
  while ((at = page.find('<', at)) != std::string::npos) {
    // Pictures and data are long: the expression is given the tag alone.
    const std::size_t end = page.find('>', at);
    if (end == std::string::npos) return "no end of a tag";
    std::string tag = page.substr(at, end + 1 - at);
    if (const std::size_t data = tag.find("base64,"); data != std::string::npos)
      tag.erase(data, tag.find('"', data) - data);
    std::smatch match;
    if (!std::regex_match(tag, match, kTag)) return "no tag: " + tag.substr(0, 80);
    const std::string name = match[2];
    at = end + 1;
    if (match[1] == "/") {
      if (open.empty() || open.back() != name) return "closes out of order: " + tag;
      open.pop_back();
    } else if (kVoid.count(name) == 0 && match[4] != "/") {
      open.push_back(name);
      if (name == "script" || name == "style") at = page.find("</" + name + ">", at);  // raw text
    }
  }
  return open.empty() ? "" : "not closed: " + open.back();
}

}  // namespace tessera::test
