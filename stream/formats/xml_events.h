/// \file xml_events.h
/// XML as it streams by: elements begin and end. No document type declarations, and so no entities that unfold.
#pragma once
#include <cstdint>
#include <exception>
#include <memory>
#include <string>
#include <string_view>

struct XML_ParserStruct;

namespace tessera {

class XmlEvents {
 public:
  /// \param where  begins every message: "part.3mf: entry '3D/3dmodel.model'"
  explicit XmlEvents(std::string where);
  virtual ~XmlEvents();
  XmlEvents(const XmlEvents&) = delete;
  XmlEvents& operator=(const XmlEvents&) = delete;

  /// The next bytes; false once stop() was called. \throws InputError naming the line; what the handlers throw
  bool feed(std::string_view bytes);
  /// The document is complete. \throws InputError where it is not
  void finish();

 protected:
  /// name, value, name, value, ..., null
  using Attributes = const char* const*;
  virtual void start(std::string_view name, Attributes attributes) = 0;
  virtual void end(std::string_view name) = 0;
  virtual void text(std::string_view) {}
  /// No more events: feed() returns false.
  void stop();
  /// Offset of the event at hand in the document.
  std::uint64_t offset() const;
  /// Names the place that the parser has come to.
  [[noreturn]] virtual void fail(const std::string& what) const;
  /// Value of an attribute by its name without prefix; null where there is none.
  static const char* attribute(Attributes attributes, std::string_view name);
  /// Behind the colon.
  static std::string_view local(std::string_view name);

 private:
  struct Calls;
  struct Free {
    void operator()(XML_ParserStruct* parser) const;
  };
  void parse(std::string_view bytes, bool last);

  std::string where_;
  std::unique_ptr<XML_ParserStruct, Free> parser_;
  std::exception_ptr error_;
  bool stopped_ = false;
  std::uint64_t fed_ = 0;
};

}  // namespace tessera
