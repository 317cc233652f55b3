#include "stream/formats/xml_events.h"

#include <expat.h>

#include <algorithm>
#include <new>

#include "octree/error.h"

namespace tessera {

namespace {
constexpr std::uint64_t kLongestXmlTag = std::uint64_t{1} << 20;
}

/// Exceptions do not pass through the C library: they wait until it has returned.
struct XmlEvents::Calls {
  template <class F>
  static void guarded(void* self, F&& f) {
    auto& events = *static_cast<XmlEvents*>(self);
    if (events.error_ || events.stopped_) return;
    try {
      f(events);
    } catch (...) {
      events.error_ = std::current_exception();
      XML_StopParser(events.parser_.get(), XML_FALSE);
    }
  }
  static void start(void* self, const char* name, const char** attributes) {
    guarded(self, [&](XmlEvents& e) { e.start(name, attributes); });
  }
  static void end(void* self, const char* name) {
    guarded(self, [&](XmlEvents& e) { e.end(name); });
  }
  static void text(void* self, const char* bytes, int count) {
    guarded(self, [&](XmlEvents& e) { e.text({bytes, static_cast<std::size_t>(count)}); });
  }
  static void doctype(void* self, const char*, const char*, const char*, int) {
    guarded(self, [](XmlEvents& e) { e.fail("a document type declaration, which Tessera does not follow"); });
  }
};

void XmlEvents::Free::operator()(XML_ParserStruct* parser) const {
  XML_ParserFree(parser);
}

XmlEvents::XmlEvents(std::string where) : where_(std::move(where)), parser_(XML_ParserCreate(nullptr)) {
  if (!parser_) throw std::bad_alloc();
  XML_SetUserData(parser_.get(), this);
  XML_SetElementHandler(parser_.get(), Calls::start, Calls::end);
  XML_SetCharacterDataHandler(parser_.get(), Calls::text);
  XML_SetStartDoctypeDeclHandler(parser_.get(), Calls::doctype);
}

XmlEvents::~XmlEvents() = default;

void XmlEvents::parse(std::string_view bytes, bool last) {
  const auto status =
      XML_Parse(parser_.get(), bytes.data(), static_cast<int>(bytes.size()), last ? XML_TRUE : XML_FALSE);
  if (error_) std::rethrow_exception(error_);
  if (stopped_) return;
  if (status != XML_STATUS_OK) fail(XML_ErrorString(XML_GetErrorCode(parser_.get())));
  fed_ += bytes.size();
  if (fed_ > offset() + kLongestXmlTag) fail("a word or tag of more than 1 MiB");
}

bool XmlEvents::feed(std::string_view bytes) {
  constexpr std::size_t kStep = std::size_t{1} << 16;
  for (; !bytes.empty() && !stopped_; bytes.remove_prefix(std::min(kStep, bytes.size())))
    parse(bytes.substr(0, kStep), false);
  return !stopped_;
}

void XmlEvents::finish() {
  if (!stopped_) parse({}, true);
}

void XmlEvents::stop() {
  stopped_ = true;
  XML_StopParser(parser_.get(), XML_FALSE);
}

std::uint64_t XmlEvents::offset() const {
  return static_cast<std::uint64_t>(std::max<XML_Index>(0, XML_GetCurrentByteIndex(parser_.get())));
}

void XmlEvents::fail(const std::string& what) const {
  throw InputError(where_ + ": line " + std::to_string(XML_GetCurrentLineNumber(parser_.get())) + ": " +
                   what);
}

const char* XmlEvents::attribute(Attributes attributes, std::string_view name) {
  for (; *attributes != nullptr; attributes += 2)
    if (local(attributes[0]) == name) return attributes[1];
  return nullptr;
}

std::string_view XmlEvents::local(std::string_view name) {
  return name.substr(name.rfind(':') + 1);
}

}  // namespace tessera
