#include "core/formats/hdf5_file.h"

#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>

#include "core/errors.h"
#include "core/formats/child_process.h"
#include "core/formats/hdf5_library.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

bool has_process = true;

/// Whether a file begins as one of HDF5: its mark stands at 0, or behind a block of the user's.
bool is_hdf5(std::string_view bytes) {
  for (std::size_t place = 0; place + 8 <= bytes.size();
       place = std::max<std::size_t>(512, 2 * place))
    if (bytes.substr(place, 8) == "\x89HDF\r\n\x1a\n") return true;
  return false;
}

/// Appends a value to a message, or takes one from its beginning.
template <class Value>
void put(std::string& message, const Value& value) {
  message.append(reinterpret_cast<const char*>(&value), sizeof value);
}
template <class Value>
void get(std::string_view& message, Value& value) {
  std::memcpy(&value, message.data(), sizeof value);
  message.remove_prefix(sizeof value);
}

void put(std::string& message, const std::string& text) {
  put(message, text.size());
  message += text;
}
void get(std::string_view& message, std::string& text) {
  std::size_t size = 0;
  get(message, size);
  text = message.substr(0, size);
  message.remove_prefix(size);
}

template <class Value>
void put(std::string& message, const std::vector<Value>& values) {
  put(message, values.size());
  for (const Value& value : values) put(message, value);
}
template <class Value>
void get(std::string_view& message, std::vector<Value>& values) {
  std::size_t size = 0;
  get(message, size);
  values.resize(size);
  for (Value& value : values) get(message, value);
}

/// What goes before each part of an answer.
struct Header {
  enum Kind { Piece, Done, Failed } kind = Done;
  Index total = 0;       ///< values of the whole dataset
  std::size_t size = 0;  ///< bytes that follow
};

void send_part(const Socket& socket, const Header& header, const void* bytes) {
  // A parent that has ended needs no answer.
  if (!socket.send(&header, sizeof header) || !socket.send(bytes, header.size))
    std::_Exit(EXIT_FAILURE);
}

/// What a question names: an object, and for some an attribute of it.
using Names = std::vector<std::string>;

/// Answers a question in the child: calls a member of the library and sends what it returns, or the
/// pieces that it hands out.
using Answer = void (*)(const Hdf5Library&, const Names&, const Socket&);

template <auto member>
void answer_value(const Hdf5Library& library, const Names& names, const Socket& socket) {
  std::string message;
  if constexpr (std::is_invocable_v<decltype(member), const Hdf5Library&, const std::string&>)
    put(message, (library.*member)(names.at(0)));
  else
    put(message, (library.*member)(names.at(0), names.at(1)));
  send_part(socket, {.kind = Header::Done, .size = message.size()}, message.data());
}

template <class Value, auto member>
void answer_pieces(const Hdf5Library& library, const Names& names, const Socket& socket) {
  (library.*member)(names.at(0), [&](Index total, std::span<const Value> piece) {
    send_part(socket, {.kind = Header::Piece, .total = total, .size = piece.size_bytes()},
              piece.data());
  });
  send_part(socket, {}, nullptr);
}

/// A question: how to answer it (the child is a copy of this process, so that functions have the
/// same addresses in both), and the names.
struct Question {
  Answer answer = nullptr;
  std::size_t size = 0;  ///< of the message with the names
};

void send_failure(const Socket& socket, const char* why) {
  send_part(socket, {.kind = Header::Failed, .size = std::strlen(why)}, why);
}

/// The child: opens the file, then answers questions until nobody asks any more.
void serve(const fs::path& path, const Socket& socket) try {
  const Hdf5Library library(path);
  send_part(socket, {}, nullptr);
  Question question;
  while (socket.receive(&question, sizeof question)) {
    std::string message(question.size, '\0');
    if (!socket.receive(message.data(), message.size())) return;
    std::string_view rest = message;
    Names names;
    get(rest, names);
    try {
      question.answer(library, names, socket);
    } catch (const std::exception& error) {
      send_failure(socket, error.what());
    }
  }
} catch (const std::exception& error) {
  send_failure(socket, error.what());
}

}  // namespace

/// The library itself, or a process that has the file open.
struct Hdf5File::Impl {
  explicit Impl(const fs::path& path) : path(path) {
    if (!has_process) {
      library = std::make_unique<Hdf5Library>(path);
      return;
    }
    std::error_code error;
    const std::uint64_t size = fs::file_size(path, error);
    if (error) fail_reading(path, error.message());
    process = std::make_unique<ChildProcess>(seconds_to_read(size),
                                             [&](const Socket& socket) { serve(path, socket); });
    receive_header();
  }

  [[noreturn]] void fail_crashed() const {
    fail_reading(path, "it is damaged: the HDF5 library fails on it; copy or write it again");
  }

  void receive(void* bytes, std::size_t size) const {
    if (!process->socket().receive(bytes, size)) fail_crashed();
  }

  Header receive_header() const {
    Header header;
    receive(&header, sizeof header);
    if (header.kind != Header::Failed) return header;
    std::string text(header.size, '\0');
    receive(text.data(), text.size());
    throw IoError(text);
  }

  void ask(Answer answer, const Names& names) const {
    std::string message;
    put(message, names);
    const Question question{.answer = answer, .size = message.size()};
    if (!process->socket().send(&question, sizeof question) ||
        !process->socket().send(message.data(), message.size()))
      fail_crashed();
  }

  /// What a member of the library returns.
  template <auto member, class... Name>
  auto value(const Name&... names) const {
    if (library) return ((*library).*member)(names...);
    ask(answer_value<member>, {names...});
    std::string message(receive_header().size, '\0');
    receive(message.data(), message.size());
    std::string_view rest = message;
    decltype(((*library).*member)(names...)) result;
    get(rest, result);
    return result;
  }

  /// All that a member hands out in pieces.
  template <class Value, auto member>
  std::vector<Value> values(const std::string& dataset) const {
    std::vector<Value> all;
    if (library) {
      ((*library).*member)(dataset, [&](Index total, std::span<const Value> piece) {
        all.reserve(std::size_t(total));
        all.insert(all.end(), piece.begin(), piece.end());
      });
      return all;
    }
    ask(answer_pieces<Value, member>, {dataset});
    for (std::size_t at = 0;;) {
      const Header header = receive_header();
      if (header.kind == Header::Done) return all;
      all.resize(std::size_t(header.total));
      receive(all.data() + at, header.size);
      at += header.size / sizeof(Value);
    }
  }

  fs::path path;
  std::unique_ptr<const Hdf5Library> library;
  std::unique_ptr<const ChildProcess> process;
};

Recognition recognise_hdf5(const FileStart& start, const std::string& object,
                           std::string_view mark) {
  if (start.is_folder || !is_hdf5(start.bytes)) return Recognition::No;
  if (start.bytes.find(mark) != std::string::npos) return Recognition::Sure;
  try {
    if (!start.hdf5) start.hdf5 = std::make_shared<const Hdf5File>(start.path);
    return start.hdf5->has(object) ? Recognition::Sure : Recognition::No;
  } catch (const IoError&) {
    return Recognition::Possible;
  }
}

void read_without_process() { has_process = false; }

Hdf5File::Hdf5File(const fs::path& path) : impl_(std::make_unique<Impl>(path)) {}

Hdf5File::~Hdf5File() = default;
Hdf5File::Hdf5File(Hdf5File&&) noexcept = default;
Hdf5File& Hdf5File::operator=(Hdf5File&&) noexcept = default;

const fs::path& Hdf5File::path() const { return impl_->path; }

bool Hdf5File::has(const std::string& object) const {
  return impl_->value<&Hdf5Library::has>(object);
}

bool Hdf5File::is_dataset(const std::string& object) const {
  return impl_->value<&Hdf5Library::is_dataset>(object);
}

std::vector<std::string> Hdf5File::children(const std::string& group) const {
  return impl_->value<&Hdf5Library::children>(group);
}

std::vector<Index> Hdf5File::shape(const std::string& dataset) const {
  return impl_->value<&Hdf5Library::shape>(dataset);
}

std::vector<Index> Hdf5File::integers(const std::string& dataset) const {
  return impl_->values<Index, &Hdf5Library::integers>(dataset);
}

std::vector<double> Hdf5File::numbers(const std::string& dataset) const {
  return impl_->values<double, &Hdf5Library::numbers>(dataset);
}

std::vector<std::string> Hdf5File::texts(const std::string& dataset) const {
  return impl_->value<&Hdf5Library::texts>(dataset);
}

bool Hdf5File::is_integral(const std::string& dataset) const {
  return impl_->value<&Hdf5Library::is_integral>(dataset);
}

Hdf5Number Hdf5File::coordinate_type(const std::string& dataset) const {
  return impl_->value<&Hdf5Library::coordinate_type>(dataset);
}

std::vector<Hdf5Extent> Hdf5File::extents(const std::string& dataset) const {
  return impl_->value<&Hdf5Library::extents>(dataset);
}

bool Hdf5File::has_attribute(const std::string& object, const std::string& name) const {
  return impl_->value<&Hdf5Library::has_attribute>(object, name);
}

std::vector<Index> Hdf5File::integer_attribute(const std::string& object,
                                               const std::string& name) const {
  return impl_->value<&Hdf5Library::integer_attribute>(object, name);
}

std::vector<double> Hdf5File::number_attribute(const std::string& object,
                                               const std::string& name) const {
  return impl_->value<&Hdf5Library::number_attribute>(object, name);
}

std::string Hdf5File::text_attribute(const std::string& object, const std::string& name) const {
  return impl_->value<&Hdf5Library::text_attribute>(object, name);
}

void Hdf5File::fail(const std::string& object, const std::string& why) const {
  fail_reading(path(), "'" + object + "': " + why);
}

}  // namespace cadmorph
