// SPDX-License-Identifier: Apache-2.0
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <locale>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace py = pybind11;

namespace {

constexpr std::size_t kLongestName = 255;       // bytes; numpy pads every name to the longest
constexpr std::size_t kMaxPadding = 16;         // times the size of the text, plus
constexpr std::size_t kFreePadding = 64 << 20;  // bytes for any text
constexpr int kNanosecondDigits = 9;

bool is_digit(char c) { return c >= '0' && c <= '9'; }

std::size_t bytes_of_code_point(char lead) {
  const auto byte = static_cast<unsigned char>(lead);
  if (byte < 0x80) return 1;
  if (byte >= 0xC2 && byte < 0xE0) return 2;
  if (byte >= 0xE0 && byte < 0xF0) return 3;
  return byte >= 0xF0 && byte < 0xF5 ? 4 : 0;
}

/// Reads one code point and advances `at`; false if the bytes are not UTF-8.
bool next_code_point(const char*& at, const char* end, char32_t& code) {
  constexpr char32_t kSmallest[] = {0, 0, 0x80, 0x800, 0x10000};
  const std::size_t size = bytes_of_code_point(*at);
  if (size == 0 || static_cast<std::size_t>(end - at) < size) return false;
  const auto lead = static_cast<unsigned char>(*at);
  code = size == 1 ? lead : lead & (0xFFU >> (size + 1));
  for (std::size_t i = 1; i < size; ++i) {
    const auto byte = static_cast<unsigned char>(at[i]);
    if ((byte & 0xC0U) != 0x80U) return false;
    code = (code << 6U) | (byte & 0x3FU);
  }
  at += size;
  return code >= kSmallest[size] && code <= 0x10FFFF && (code < 0xD800 || code > 0xDFFF);
}

/// Number of code points of UTF-8 text, or -1 if the text is not UTF-8.
std::ptrdiff_t count_code_points(std::string_view text) {
  std::ptrdiff_t count = 0;
  char32_t code = 0;
  for (const char *at = text.data(), *end = at + text.size(); at != end; ++count) {
    if (!next_code_point(at, end, code)) return -1;
  }
  return count;
}

/// Printable form of bytes for an error message.
std::string quoted(std::string_view text) {
  constexpr std::size_t kLongest = 40;
  constexpr char kHex[] = "0123456789abcdef";
  std::string shown = "'";
  for (const char c : text.substr(0, kLongest)) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x20 && byte < 0x7F) {
      shown += c;
    } else {
      shown += {'\\', 'x', kHex[byte >> 4U], kHex[byte & 15U]};
    }
  }
  return shown + (text.size() > kLongest ? "...'" : "'");
}

/// std::from_chars does not distinguish underflow from overflow; underflow is a valid number.
bool parse_extreme(const char* first, const char* last, double& value) {
  std::istringstream stream(std::string(first, last));
  stream.imbue(std::locale::classic());
  return static_cast<bool>(stream >> value);
}

/// End of the float64 (finite or not) that starts at `at`; nullptr if there is none.
const char* scan_double(const char* at, const char* end, double& value) {
  if (end - at > 1 && *at == '+' && at[1] != '-' && at[1] != '+') ++at;
  const auto [stop, error] = std::from_chars(at, end, value);
  if (error == std::errc::result_out_of_range && !parse_extreme(at, stop, value)) {
    value = std::numeric_limits<double>::infinity();
  }
  return error == std::errc::invalid_argument ? nullptr : stop;
}

const char* scan_finite(const char* at, const char* end, double& value) {
  const char* stop = scan_double(at, end, value);
  return stop != nullptr && std::isfinite(value) ? stop : nullptr;
}

/// Decimal number in parts: its digits, and how many of them precede the point.
struct Decimal {
  bool negative = false;
  const char* digits = nullptr;  ///< may contain one '.'
  const char* digits_end = nullptr;
  std::int64_t before_point = 0;
};

/// End of the exponent that starts at `at`; `at` itself if there is none.
const char* scan_exponent(const char* at, const char* end, std::int64_t& exponent) {
  constexpr std::int64_t kHuge =
      1'000'000'000;  // larger than any text; prevents overflow of the sum
  exponent = 0;
  if (at == end || (*at != 'e' && *at != 'E')) return at;
  const char* c = at + 1;
  const bool negative = c != end && *c == '-';
  if (c != end && (*c == '-' || *c == '+')) ++c;
  if (c == end || !is_digit(*c)) return at;
  for (; c != end && is_digit(*c); ++c) exponent = std::min(kHuge, exponent * 10 + (*c - '0'));
  if (negative) exponent = -exponent;
  return c;
}

const char* scan_decimal(const char* at, const char* end, Decimal& decimal) {
  decimal.negative = at != end && *at == '-';
  if (at != end && (*at == '-' || *at == '+')) ++at;
  decimal.digits = at;
  while (at != end && is_digit(*at)) ++at;
  const std::ptrdiff_t whole = at - decimal.digits;
  std::ptrdiff_t fraction = 0;
  if (at != end && *at == '.') {
    const char* point = at++;
    while (at != end && is_digit(*at)) ++at;
    fraction = at - point - 1;
  }
  if (whole + fraction == 0) return nullptr;
  decimal.digits_end = at;
  std::int64_t exponent = 0;
  at = scan_exponent(at, end, exponent);
  decimal.before_point = whole + exponent;
  return at;
}

/// Converts decimal seconds to nanoseconds, rounded half away from zero; false on overflow.
bool to_nanoseconds(const Decimal& decimal, std::int64_t& nanoseconds) {
  const std::uint64_t limit =
      static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()) + decimal.negative;
  std::int64_t left = decimal.before_point + kNanosecondDigits;  // digits worth 1 ns or more
  std::uint64_t magnitude = 0;
  for (const char* c = decimal.digits; c != decimal.digits_end && left >= 0; ++c) {
    if (*c == '.') continue;
    const auto digit = static_cast<std::uint64_t>(*c - '0');
    if (left-- == 0) {
      magnitude += digit >= 5;
    } else if (magnitude > (limit - digit) / 10) {
      return false;
    } else {
      magnitude = magnitude * 10 + digit;
    }
  }
  for (; left > 0 && magnitude > 0; --left) {
    if (magnitude > limit / 10) return false;
    magnitude *= 10;
  }
  if (magnitude > limit) return false;
  nanoseconds = static_cast<std::int64_t>(decimal.negative ? 0 - magnitude : magnitude);
  return true;
}

const char* scan_seconds(const char* at, const char* end, std::int64_t& nanoseconds) {
  Decimal decimal;
  const char* stop = scan_decimal(at, end, decimal);
  return stop != nullptr && to_nanoseconds(decimal, nanoseconds) ? stop : nullptr;
}

/// Column under construction; only the vector of its kind is used.
struct Column {
  char kind = 'f';
  std::vector<double> numbers;
  std::vector<std::int64_t> stamps;
  std::vector<std::string_view> names;  ///< into the text
  std::ptrdiff_t longest_name = 1;      ///< [code points]
  std::int64_t longest_line = 0;        ///< line of the longest name

  std::size_t rows() const { return numbers.size() + stamps.size() + names.size(); }
  void reserve(std::size_t rows) {
    if (kind == 't') {
      names.reserve(rows);
    } else if (kind == 's') {
      stamps.reserve(rows);
    } else {
      numbers.reserve(rows);
    }
  }
};

/// Parses a table in one pass. Numbers are parsed in place and must end where the field ends, so
/// fields are not split first; a line that fails is parsed again, slowly, to explain the error.
class TableParser {
 public:
  TableParser(std::string_view text, const std::string& kinds, char delimiter, std::string name)
      : at_(text.data()), end_(at_ + text.size()), delimiter_(delimiter), name_(std::move(name)) {
    for (const char kind : kinds) {
      columns_.emplace_back();
      columns_.back().kind = kind;
    }
  }

  std::vector<Column> parse(std::int64_t first_line) {
    const std::size_t max_bytes = kMaxPadding * static_cast<std::size_t>(end_ - at_) + kFreePadding;
    for (line_ = 1; at_ != end_; ++line_) {
      if (line_ >= first_line && !is_skipped()) {
        if (columns_.front().rows() == 0) reserve();
        parse_line();
      }
      at_ = line_end(at_);
      if (at_ != end_) ++at_;
    }
    check_padding(max_bytes);
    return std::move(columns_);
  }

 private:
  bool is_blank(char c) const { return c == ' ' || (c == '\t' && delimiter_ != '\t'); }
  bool ends_line(const char* c) const {
    return c == end_ || *c == '\n' || (*c == '\r' && (c + 1 == end_ || c[1] == '\n'));
  }
  const char* skip_blanks(const char* c) const {
    while (c != end_ && is_blank(*c)) ++c;
    return c;
  }
  const char* line_end(const char* c) const {
    const void* newline = std::memchr(c, '\n', static_cast<std::size_t>(end_ - c));
    return newline != nullptr ? static_cast<const char*>(newline) : end_;
  }
  bool is_skipped() const { return *at_ == '#' || ends_line(skip_blanks(at_)); }

  /// Reserves rows for the rest of the text, assuming lines about as long as this one.
  void reserve() {
    const auto line = static_cast<std::size_t>(line_end(at_) - at_) + 1;
    const auto rows = static_cast<std::size_t>(end_ - at_) / line;
    for (Column& column : columns_) column.reserve(rows + rows / 16 + 1);
  }

  void parse_line() {
    const char* const begin = at_;
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      at_ = parse_field(columns_[i], skip_blanks(at_));
      if (at_ == nullptr || !step_over_separator(i + 1 == columns_.size())) explain(begin);
    }
  }

  /// Advances from the end of a field to the start of the next, or to the end of the line.
  bool step_over_separator(bool is_last) {
    const char* stop = skip_blanks(at_);
    if (is_last) {
      at_ = stop;
      return ends_line(stop);
    }
    const bool is_separated = delimiter_ == ' ' ? stop != at_ : stop != end_ && *stop == delimiter_;
    at_ = delimiter_ == ' ' ? stop : stop + 1;
    return is_separated;
  }

  /// Parses the field that starts at `at` and returns its end, or nullptr if it is not valid.
  const char* parse_field(Column& column, const char* at) const {
    if (column.kind == 't') return parse_name(column, at);
    if (column.kind == 's') {
      std::int64_t stamp = 0;
      const char* stop = scan_seconds(at, end_, stamp);
      column.stamps.push_back(stamp);
      return stop;
    }
    double number = std::numeric_limits<double>::quiet_NaN();
    const bool may_be_empty = column.kind == 'g' && delimiter_ != ' ';
    const bool is_empty = may_be_empty && (ends_line(at) || *at == delimiter_);
    const char* stop = is_empty ? at : scan_finite(at, end_, number);
    column.numbers.push_back(number);
    return stop;
  }

  /// Throws if the names take more than `max_bytes` in numpy, which pads a column to its longest
  /// name.
  void check_padding(std::size_t max_bytes) {
    const auto bytes = [](const Column& column) {
      return sizeof(char32_t) * static_cast<std::size_t>(column.longest_name) * column.names.size();
    };
    std::size_t sum = 0;
    for (const Column& column : columns_) sum += bytes(column);
    if (sum <= max_bytes) return;
    const auto worst =
        std::max_element(columns_.begin(), columns_.end(),
                         [&](const Column& a, const Column& b) { return bytes(a) < bytes(b); });
    line_ = worst->longest_line;
    fail("column " + std::to_string(worst - columns_.begin() + 1) + " has a name of " +
         std::to_string(worst->longest_name) + " characters, and " +
         std::to_string(worst->names.size()) + " rows, each padded to that length: " +
         std::to_string(sum >> 20U) + " MB in all; shorten it");
  }

  const char* parse_name(Column& column, const char* at) const {
    const char* stop = at;
    while (!ends_line(stop) && *stop != delimiter_ && !(delimiter_ == ' ' && *stop == '\t')) ++stop;
    const char* const field_end = stop;
    while (stop != at && is_blank(stop[-1])) --stop;
    const std::string_view name(at, static_cast<std::size_t>(stop - at));
    const std::ptrdiff_t length = name.size() > kLongestName ? -1 : count_code_points(name);
    if (length < 0 || (name.empty() && delimiter_ == ' ')) return nullptr;
    if (length > column.longest_name) {
      column.longest_name = length;
      column.longest_line = line_;
    }
    column.names.push_back(name);
    return field_end;
  }

  [[noreturn]] void fail(const std::string& text) const {
    throw std::invalid_argument(name_ + ", line " + std::to_string(line_) + ": " + text);
  }

  std::string_view trimmed(const char* first, const char* last) const {
    while (first != last && is_blank(*first)) ++first;
    while (last != first && is_blank(last[-1])) --last;
    return {first, static_cast<std::size_t>(last - first)};
  }

  std::vector<std::string_view> fields_of(const char* at) const {
    const char* last = line_end(at);
    if (last != at && last[-1] == '\r') --last;
    std::vector<std::string_view> fields;
    if (delimiter_ == ' ') {
      for (at = skip_blanks(at); at < last; at = skip_blanks(at)) {
        const char* const begin = at;
        at = std::find_if(at, last, [this](char c) { return is_blank(c); });
        fields.push_back(trimmed(begin, at));
      }
      return fields;
    }
    while (true) {
      const char* const stop = std::find(at, last, delimiter_);
      fields.push_back(trimmed(at, stop));
      if (stop == last) return fields;
      at = stop + 1;
    }
  }

  /// Description of what is wrong with a field; empty if it is valid.
  static std::string complaint(char kind, std::string_view field) {
    const char *first = field.data(), *last = first + field.size();
    if (kind == 't') {
      if (field.size() > kLongestName) return "is longer than 255 bytes";
      return count_code_points(field) < 0 ? "is not UTF-8 text" : "";
    }
    if (kind == 'g' && field.empty()) return "";
    double number = 0.0;
    Decimal decimal;
    const bool is_decimal = kind == 's' && scan_decimal(first, last, decimal) == last;
    if (!is_decimal && scan_double(first, last, number) != last) return "is not a number";
    if (!is_decimal) return std::isfinite(number) ? "" : "is not finite";
    std::int64_t stamp = 0;
    return to_nanoseconds(decimal, stamp) ? "" : "does not fit into 64-bit nanoseconds";
  }

  [[noreturn]] void explain(const char* line) const {
    const std::vector<std::string_view> fields = fields_of(line);
    if (fields.size() != columns_.size()) {
      const std::string found =
          fields.size() == 1 ? "1 field" : std::to_string(fields.size()) + " fields";
      fail(found + ", expected " + std::to_string(columns_.size()));
    }
    for (std::size_t i = 0; i < fields.size(); ++i) {
      const std::string text = complaint(columns_[i].kind, fields[i]);
      if (!text.empty()) {
        const std::string column = "column " + std::to_string(i + 1);
        fail(fields[i].empty() ? column + " is empty, expected a number"
                               : column + " (" + quoted(fields[i]) + ") " + text);
      }
    }
    fail("cannot be read");
  }

  const char* at_;
  const char* end_;
  char delimiter_;
  std::string name_;
  std::int64_t line_ = 1;
  std::vector<Column> columns_;
};

/// Moves a vector into a numpy array without copying.
template <class T>
py::array to_numpy(std::vector<T>&& values) {
  auto owner = std::make_unique<std::vector<T>>(std::move(values));
  const auto size = static_cast<py::ssize_t>(owner->size());
  T* const data = owner->data();
  const py::capsule base(owner.get(), [](void* p) { delete static_cast<std::vector<T>*>(p); });
  owner.release();
  return py::array_t<T>(size, data, base);
}

py::array to_numpy(const Column& column) {
  const py::dtype dtype("U" + std::to_string(column.longest_name));
  py::array names(dtype, static_cast<py::ssize_t>(column.names.size()));
  auto* cell = static_cast<char32_t*>(names.mutable_data());
  for (const std::string_view name : column.names) {
    char32_t* const next = cell + column.longest_name;
    for (const char *at = name.data(), *end = at + name.size(); at != end; ++cell) {
      next_code_point(at, end, *cell);
    }
    cell = std::fill_n(cell, next - cell, U'\0');
  }
  return names;
}

void check_arguments(const std::string& kinds, const std::string& delimiter) {
  if (kinds.empty() || kinds.find_first_not_of("fgst") != std::string::npos) {
    throw std::invalid_argument("kinds is '" + kinds + "', expected letters among f, g, s, t");
  }
  if (delimiter.size() != 1 || std::string(",;|\t ").find(delimiter) == std::string::npos) {
    throw std::invalid_argument("delimiter is " + quoted(delimiter) +
                                ", expected one of ',', ';', '|', tab, space");
  }
}

py::typing::List<py::array> parse_table(const py::bytes& text, const std::string& kinds,
                                        const std::string& delimiter, std::int64_t first_line,
                                        std::string name) {
  check_arguments(kinds, delimiter);
  std::vector<Column> columns;
  TableParser parser(static_cast<std::string_view>(text), kinds, delimiter[0], std::move(name));
  {
    const py::gil_scoped_release release;
    columns = parser.parse(first_line);
  }
  py::typing::List<py::array> arrays;
  for (Column& column : columns) {
    if (column.kind == 't') {
      arrays.append(to_numpy(column));
    } else if (column.kind == 's') {
      arrays.append(to_numpy(std::move(column.stamps)));
    } else {
      arrays.append(to_numpy(std::move(column.numbers)));
    }
  }
  return arrays;
}

}  // namespace

void bind_text(py::module_& m) {
  m.def("parse_table", &parse_table, py::arg("text"), py::arg("kinds"), py::arg("delimiter"),
        py::arg("first_line"), py::arg("name"),
        R"(Parse delimited decimal text, column by column.

Blank lines and lines that start with ``#`` are skipped. Spaces and tabs around a field are ignored.
Quotes have no special meaning.

Parameters
----------
text : bytes
    UTF-8; lines end in ``\n`` or ``\r\n``.
kinds : str
    One letter per column: ``f`` finite float64; ``g`` the same, where an empty field is NaN;
    ``s`` decimal seconds converted exactly to int64 nanoseconds (fractions of a nanosecond are
    rounded half away from zero); ``t`` text of at most 255 bytes.
delimiter : str
    ``,``, ``;``, ``|``, tab, or a space for any run of spaces and tabs.
first_line : int
    Number of the first line to parse, from 1; lines before it (a header) are skipped.
name : str
    Name of the text in error messages.

Returns
-------
list of array
    One per column, shape (rows,): float64, int64 [ns] or str.

Raises
------
ValueError
    If a line has too few or too many fields or a field is not of its kind; the text names the
    line and the column, both from 1. Also if the names, each padded to the longest of its column,
    would take more than 64 MB plus 16 times the size of the text.

Examples
--------
>>> stamp_ns, name = parse_table(b"stamp_s,tag\n1.25,left\n", "st", ",", 2, "example")
>>> int(stamp_ns[0]), str(name[0])
(1250000000, 'left')
)");
}
