#include "core/mesh_file.h"

#include <fcntl.h>
#include <unistd.h>
#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDoubleArray.h>
#include <vtkErrorCode.h>
#include <vtkFieldData.h>
#include <vtkIdTypeArray.h>
#include <vtkIntArray.h>
#include <vtkLogger.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkOutputWindow.h>
#include <vtkPointData.h>
#include <vtkSmartPointer.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>
#include <vtkUnstructuredGridReader.h>
#include <vtkUnstructuredGridWriter.h>
#include <vtkXMLUnstructuredGridReader.h>
#include <vtkXMLUnstructuredGridWriter.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <exception>
#include <fstream>
#include <limits>
#include <mutex>
#include <optional>
#include <streambuf>
#include <string>
#include <string_view>
#include <utility>

#include "core/errors.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

using Grid = vtkSmartPointer<vtkUnstructuredGrid>;

/// Cell arrays that tools keep region ids in, most telling first: one of a geometric entity divides
/// at least as finely as one of a material.
constexpr const char* kRegionArrays[] = {
    "CellEntityIds", "gmsh:geometrical", "gmsh:physical",   "MaterialIds", "MaterialId",
    "material",      "Material",         "RegionIds",       "RegionId",    "region",
    "Region",        "regions",          "ElementBlockIds", "cell_tags",   "CellTags",
    "medit:ref",     "cell_ids",         "PartIds",         "PartId"};

// ---- VTK's messages -----------------------------------------------------------------------------

thread_local std::vector<std::string>* collected_errors = nullptr;

/// Collects the errors of VTK in a thread that asks for them; passes all else on.
class CollectingWindow : public vtkOutputWindow {
 public:
  static CollectingWindow* New();

  void DisplayErrorText(const char* text) override {
    if (!collected_errors)
      previous->DisplayErrorText(text);
    else if (!is_harmless(text))
      collected_errors->emplace_back(text);
  }
  void DisplayWarningText(const char* text) override {
    if (!collected_errors) previous->DisplayWarningText(text);
  }
  void DisplayGenericWarningText(const char* text) override {
    if (!collected_errors) previous->DisplayGenericWarningText(text);
  }
  void DisplayText(const char* text) override {
    if (!collected_errors) previous->DisplayText(text);
  }

  vtkSmartPointer<vtkOutputWindow> previous;

 private:
  /// The range of values that VTK's writer notes down with an array, and its reader refuses where
  /// it is infinite, though the array is sound; and an empty mesh, which check_mesh finds.
  static bool is_harmless(std::string_view text) {
    return text.find("Error reading InformationKey") != text.npos ||
           text.find("No Points element") != text.npos;
  }
};
vtkStandardNewMacro(CollectingWindow)

    /// While it lives, VTK prints nothing in this thread; its errors are collected.
    class SilentVtk {
 public:
  SilentVtk() {
    static std::once_flag installed;
    std::call_once(installed, [] {
      vtkNew<CollectingWindow> window;
      window->previous = vtkOutputWindow::GetInstance();
      vtkOutputWindow::SetInstance(window);
      vtkLogger::SetStderrVerbosity(vtkLogger::VERBOSITY_OFF);  // it would print all a second time
    });
    collected_errors = &errors_;
  }
  ~SilentVtk() { collected_errors = nullptr; }
  SilentVtk(const SilentVtk&) = delete;
  SilentVtk& operator=(const SilentVtk&) = delete;

  bool has_errors() const { return !errors_.empty(); }

  /// The first message, without VTK's own file, line and address.
  std::string first_error() const {
    if (errors_.empty()) return "unknown error";
    std::string text = errors_.front();
    if (const auto end = text.find("): "); end != std::string::npos) text.erase(0, end + 3);
    std::ranges::replace(text, '\n', ' ');
    while (!text.empty() && (text.back() == ' ' || text.back() == '.')) text.pop_back();
    return text;
  }

 private:
  std::vector<std::string> errors_;
};

// ---- How a file is laid out ---------------------------------------------------------------------

/// What a copy of the file must share with it.
struct Layout {
  bool is_xml = true;
  int data_mode = vtkXMLWriter::Appended;
  int compressor = vtkXMLWriter::NONE;
  bool has_long_headers = true;  ///< 64-bit block headers
  bool is_appended_base64 = false;
  int legacy_version = vtkDataWriter::VTK_LEGACY_READER_VERSION_5_1;
};

[[noreturn]] void fail_reading(const fs::path& path, const std::string& why) {
  throw IoError("can't read the mesh " + path.string() + ": " + why);
}

[[noreturn]] void fail_writing(const fs::path& path, const std::string& why) {
  throw IoError("can't write the mesh " + path.string() + ": " + why);
}

/// Finds XML start tags in a file that may hold gigabytes of data between them.
class TagScanner {
 public:
  explicit TagScanner(const fs::path& path) : stream_(path, std::ios::binary) {}

  /// Returns the next start tag that begins with `opening` ("<Points"), or nothing at the end.
  std::optional<std::string> next(std::string_view opening) {
    std::size_t begin;
    while ((begin = window_.find(opening)) == std::string::npos) {
      if (window_.size() > opening.size()) window_.erase(0, window_.size() - opening.size());
      if (!read_more()) return std::nullopt;
    }
    window_.erase(0, begin);
    std::size_t end;
    while ((end = window_.find('>')) == std::string::npos)
      if (!read_more()) return std::nullopt;
    std::string tag = window_.substr(0, end);
    window_.erase(0, end);
    return tag;
  }

 private:
  bool read_more() {
    constexpr std::streamsize kBytes = 1 << 20;
    const auto size = window_.size();
    window_.resize(size + kBytes);
    stream_.read(window_.data() + size, kBytes);
    window_.resize(size + static_cast<std::size_t>(stream_.gcount()));
    return window_.size() > size;
  }

  std::ifstream stream_;
  std::string window_;
};

/// Value of an attribute in the text of a start tag; empty when it has none.
std::string attribute(const std::string& tag, const std::string& name) {
  for (std::size_t at = tag.find(name); at != std::string::npos; at = tag.find(name, at + 1)) {
    if (at == 0 || !std::isspace(static_cast<unsigned char>(tag[at - 1]))) continue;
    const auto equals = tag.find_first_not_of(" \t\r\n", at + name.size());
    if (equals == std::string::npos || tag[equals] != '=') continue;
    const auto open = tag.find_first_of("\"'", equals);
    if (open == std::string::npos) continue;
    const auto close = tag.find(tag[open], open + 1);
    if (close == std::string::npos) continue;
    return tag.substr(open + 1, close - open - 1);
  }
  return {};
}

int compressor_of(const std::string& name) {
  if (name == "vtkZLibDataCompressor") return vtkXMLWriter::ZLIB;
  if (name == "vtkLZ4DataCompressor") return vtkXMLWriter::LZ4;
  if (name == "vtkLZMADataCompressor") return vtkXMLWriter::LZMA;
  return vtkXMLWriter::NONE;
}

Layout xml_layout(const fs::path& path) {
  TagScanner scanner(path);
  const std::string file = scanner.next("<VTKFile").value_or("");
  if (const std::string type = attribute(file, "type"); type != "UnstructuredGrid")
    fail_reading(path, "it holds a VTK " + (type.empty() ? "data set of no type" : type) +
                           ", not an UnstructuredGrid; convert it to an unstructured grid");
  Layout layout;
  layout.compressor = compressor_of(attribute(file, "compressor"));
  layout.has_long_headers = attribute(file, "header_type") == "UInt64";
  std::string format;
  if (scanner.next("<Points"))
    format = attribute(scanner.next("<DataArray").value_or(""), "format");
  if (format == "ascii") layout.data_mode = vtkXMLWriter::Ascii;
  if (format == "binary") layout.data_mode = vtkXMLWriter::Binary;
  if (format == "appended")
    layout.is_appended_base64 =
        attribute(scanner.next("<AppendedData").value_or(""), "encoding") == "base64";
  return layout;
}

std::string file_start(const fs::path& path, std::size_t bytes) {
  std::ifstream stream(path, std::ios::binary);
  std::string text(bytes, '\0');
  if (!stream) fail_reading(path, std::strerror(errno));
  stream.read(text.data(), static_cast<std::streamsize>(bytes));
  text.resize(static_cast<std::size_t>(stream.gcount()));
  return text;
}

/// Whether the file's last characters hold XML's closing tag.
bool has_closing_tag(const fs::path& path) {
  constexpr std::streamoff kBytes = 4096;
  std::ifstream stream(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = stream.tellg();
  stream.seekg(std::max<std::streamoff>(0, size - kBytes));
  std::string text(static_cast<std::size_t>(std::min(kBytes, std::max<std::streamoff>(size, 0))),
                   '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  return text.find("</VTKFile>") != std::string::npos;
}

// ---- Reading ------------------------------------------------------------------------------------

template <class Reader>
Grid run_reader(Reader* reader, const fs::path& path) {
  SilentVtk vtk;
  reader->SetFileName(path.c_str());
  reader->Update();
  if (vtk.has_errors() || reader->GetErrorCode() != vtkErrorCode::NoError)
    fail_reading(path, "it is damaged or cut off (" + vtk.first_error() + ")");
  return reader->GetOutput();
}

Grid read_xml(const fs::path& path) {
  if (!has_closing_tag(path))
    fail_reading(path, "it is cut off: its closing tag is missing; write or copy it again");
  vtkNew<vtkXMLUnstructuredGridReader> reader;
  return run_reader(reader.Get(), path);
}

Grid read_legacy(const fs::path& path, Layout& layout) {
  vtkNew<vtkUnstructuredGridReader> reader;
  reader->ReadAllScalarsOn();
  reader->ReadAllVectorsOn();
  reader->ReadAllNormalsOn();
  reader->ReadAllTensorsOn();
  reader->ReadAllColorScalarsOn();
  reader->ReadAllTCoordsOn();
  reader->ReadAllFieldsOn();
  const Grid grid = run_reader(reader.Get(), path);
  layout.is_xml = false;
  if (reader->GetFileMajorVersion() < 5)
    layout.legacy_version = vtkDataWriter::VTK_LEGACY_READER_VERSION_4_2;
  return grid;
}

std::pair<Grid, Layout> read_grid(const fs::path& path) {
  std::error_code error;
  const auto status = fs::status(path, error);
  if (!fs::exists(status)) fail_reading(path, "there is no such file");
  if (fs::is_directory(status)) fail_reading(path, "it is a folder");
  const std::string start = file_start(path, 4096);
  if (start.starts_with("# vtk DataFile")) {
    Layout layout;
    const Grid grid = read_legacy(path, layout);
    return {grid, layout};
  }
  if (start.find("<VTKFile") == std::string::npos)
    fail_reading(path, "it is no VTK file; give an unstructured grid as .vtu or .vtk");
  const Layout layout = xml_layout(path);
  return {read_xml(path), layout};
}

template <class Array>
std::vector<Index> to_indices(Array* array) {
  const auto* begin = array->GetPointer(0);
  return {begin, begin + array->GetNumberOfValues()};
}

void take_cells(vtkUnstructuredGrid* grid, Mesh& mesh) {
  vtkCellArray* cells = grid->GetCells();
  mesh.offsets = {0};
  if (!cells || !grid->GetCellTypesArray()) return;
  const vtkIdType count = grid->GetNumberOfCells();
  mesh.types.resize(count);
  for (vtkIdType c = 0; c < count; ++c)
    mesh.types[c] = static_cast<CellType>(grid->GetCellTypesArray()->GetValue(c));
  if (cells->IsStorage64Bit()) {
    mesh.offsets = to_indices(cells->GetOffsetsArray64());
    mesh.connectivity = to_indices(cells->GetConnectivityArray64());
  } else {
    mesh.offsets = to_indices(cells->GetOffsetsArray32());
    mesh.connectivity = to_indices(cells->GetConnectivityArray32());
  }
}

void take_polyhedra(vtkUnstructuredGrid* grid, const fs::path& path, Mesh& mesh) {
  if (std::ranges::find(mesh.types, CellType::Polyhedron) == mesh.types.end()) return;
  vtkIdTypeArray* faces = grid->GetFaces();
  vtkIdTypeArray* locations = grid->GetFaceLocations();
  const Index cells = mesh.cell_count();
  if (!faces || !locations || locations->GetNumberOfValues() != cells)
    fail_reading(path, "its polyhedra have no faces");
  const Index size = faces->GetNumberOfValues();
  mesh.polyhedron_offsets.assign(1, 0);
  for (Index c = 0; c < cells; ++c) {
    Index at = locations->GetValue(c);
    if (mesh.types[c] == CellType::Polyhedron) {
      if (at < 0 || at >= size)
        fail_reading(path, "polyhedron " + std::to_string(c) + " has no faces");
      for (Index left = faces->GetValue(at++); left > 0; --left) {
        const Index nodes = at < size ? faces->GetValue(at) : size;
        if (nodes < 0 || nodes >= size - at)
          fail_reading(path, "the faces of polyhedron " + std::to_string(c) + " are cut off");
        for (Index i = 0; i <= nodes; ++i) mesh.polyhedron_faces.push_back(faces->GetValue(at++));
      }
    }
    mesh.polyhedron_offsets.push_back(static_cast<Index>(mesh.polyhedron_faces.size()));
  }
}

void take_points(vtkUnstructuredGrid* grid, Mesh& mesh) {
  const Index count = grid->GetNumberOfPoints();
  mesh.points.resize(count, 3);
  for (Index n = 0; n < count; ++n) grid->GetPoint(n, mesh.points.row(n).data());
}

bool is_integral(vtkDataArray* array) {
  const int type = array->GetDataType();
  return type != VTK_FLOAT && type != VTK_DOUBLE && type != VTK_BIT;
}

/// Region ids from `array` when it has one integer a cell and they differ among the cells of the
/// mesh's highest dimension; else none.
std::vector<int> regions_from(vtkDataArray* array, const Mesh& mesh) {
  if (!array || !is_integral(array) || array->GetNumberOfComponents() != 1) return {};
  using Limits = std::numeric_limits<int>;
  const int highest = dimension(mesh);
  std::vector<int> regions(mesh.types.size());
  std::optional<int> first;
  bool has_several = false;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    const double id = array->GetComponent(c, 0);
    if (id < Limits::min() || id > Limits::max()) return {};
    regions[c] = static_cast<int>(id);
    if (dimension(mesh.types[c]) != highest) continue;
    if (!first) first = regions[c];
    has_several = has_several || regions[c] != *first;
  }
  return has_several ? regions : std::vector<int>{};
}

void take_regions(vtkUnstructuredGrid* grid, Mesh& mesh) {
  for (const char* name : kRegionArrays) {
    mesh.regions = regions_from(grid->GetCellData()->GetArray(name), mesh);
    if (mesh.regions.empty()) continue;
    mesh.region_array = name;
    return;
  }
}

Mesh to_mesh(vtkUnstructuredGrid* grid, const fs::path& path) {
  Mesh mesh;
  take_points(grid, mesh);
  take_cells(grid, mesh);
  take_polyhedra(grid, path, mesh);
  try {
    check_mesh(mesh);
  } catch (const InvalidInputError& error) {
    throw InvalidInputError(path.string() + ": " + error.what());
  }
  take_regions(grid, mesh);
  return mesh;
}

// ---- Writing ------------------------------------------------------------------------------------

vtkSmartPointer<vtkPoints> to_vtk(const Points& points) {
  auto result = vtkSmartPointer<vtkPoints>::New();
  result->SetDataTypeToDouble();
  result->SetNumberOfPoints(points.rows());
  std::copy_n(points.data(), points.size(),
              vtkDoubleArray::SafeDownCast(result->GetData())->GetPointer(0));
  return result;
}

void check_rows(const std::string& name, Index rows, Index expected) {
  if (rows != expected)
    throw InvalidInputError("the array '" + name + "' to write has " + std::to_string(rows) +
                            " rows, not " + std::to_string(expected));
}

void add_arrays(vtkDataSetAttributes* data, Index count,
                const std::map<std::string, RowMatrix>& arrays,
                const std::map<std::string, std::vector<int>>& integers) {
  for (const auto& [name, values] : arrays) {
    check_rows(name, values.rows(), count);
    vtkNew<vtkDoubleArray> array;
    array->SetName(name.c_str());
    array->SetNumberOfComponents(static_cast<int>(values.cols()));
    array->SetNumberOfTuples(count);
    std::copy_n(values.data(), values.size(), array->GetPointer(0));
    data->AddArray(array);
  }
  for (const auto& [name, values] : integers) {
    check_rows(name, std::ssize(values), count);
    vtkNew<vtkIntArray> array;
    array->SetName(name.c_str());
    array->SetNumberOfTuples(count);
    std::ranges::copy(values, array->GetPointer(0));
    data->AddArray(array);
  }
}

void add_extra(vtkUnstructuredGrid* grid, const ExtraArrays& extra) {
  add_arrays(grid->GetPointData(), grid->GetNumberOfPoints(), extra.point_arrays,
             extra.point_integers);
  add_arrays(grid->GetCellData(), grid->GetNumberOfCells(), extra.cell_arrays, extra.cell_integers);
}

/// A new file beside the one to write; gone again unless it took that one's place.
class TemporaryFile {
 public:
  explicit TemporaryFile(const fs::path& target) : target_(resolve(target)) {
    static std::atomic<int> counter = 0;
    const auto folder = target_.has_parent_path() ? target_.parent_path() : fs::path(".");
    path_ = folder /
            (".cadmorph-" + std::to_string(getpid()) + "-" + std::to_string(counter++) + ".tmp");
    file_ = open(path_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
    if (file_ < 0) fail_writing(target_, std::strerror(errno));
  }
  ~TemporaryFile() {
    if (file_ >= 0) close(file_);
    if (!path_.empty()) unlink(path_.c_str());
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  /// Writes at a place in the file. Throws IoError.
  void write(const char* data, std::size_t size, off_t place) {
    while (size > 0) {
      const ssize_t written = pwrite(file_, data, size, place);
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) fail_writing(target_, std::strerror(errno));
      data += written;
      size -= static_cast<std::size_t>(written);
      place += written;
    }
  }

  /// Flushes to disk and takes the target's place.
  void commit() {
    if (fsync(file_) != 0) fail_writing(target_, std::strerror(errno));
    const int closed = close(std::exchange(file_, -1));
    if (closed != 0) fail_writing(target_, std::strerror(errno));
    if (rename(path_.c_str(), target_.c_str()) != 0) fail_writing(target_, std::strerror(errno));
    path_.clear();
  }

 private:
  static fs::path resolve(const fs::path& target) {
    std::error_code error;
    const auto status = fs::status(target, error);
    if (fs::is_directory(status)) fail_writing(target, "it is a folder");
    if (fs::exists(status) && !fs::is_regular_file(status))
      fail_writing(target, "it is no regular file");
    return fs::is_symlink(fs::symlink_status(target, error)) ? fs::weakly_canonical(target)
                                                             : target;
  }

  fs::path target_;
  fs::path path_;
  int file_ = -1;
};

/// Stream buffer onto a TemporaryFile. It keeps the first failure and goes on as if nothing were:
/// VTK's writer misses some failed writes, and crashes on others.
class FileBuffer : public std::streambuf {
 public:
  explicit FileBuffer(TemporaryFile& file) : file_(file), buffer_(1 << 20) { reset(); }

  /// Writes out what is left; throws the first failure of all.
  void finish() {
    flush();
    if (failure_) std::rethrow_exception(failure_);
  }

 protected:
  int_type overflow(int_type c) override {
    flush();
    if (!traits_type::eq_int_type(c, traits_type::eof())) sputc(traits_type::to_char_type(c));
    return traits_type::not_eof(c);
  }
  std::streamsize xsputn(const char* data, std::streamsize size) override {
    if (size > epptr() - pptr()) flush();
    if (size > epptr() - pptr()) {
      put(data, size);
      return size;
    }
    std::copy_n(data, size, pptr());
    pbump(static_cast<int>(size));
    return size;
  }
  pos_type seekoff(off_type offset, std::ios::seekdir from, std::ios::openmode) override {
    const off_type here = start_ + (pptr() - pbase());
    end_ = std::max(end_, here);
    const off_type place = offset + (from == std::ios::beg   ? 0
                                     : from == std::ios::cur ? here
                                                             : end_);
    if (place == here) return place;
    flush();
    start_ = place;
    return place;
  }
  pos_type seekpos(pos_type place, std::ios::openmode mode) override {
    return seekoff(place, std::ios::beg, mode);
  }

 private:
  void reset() { setp(buffer_.data(), buffer_.data() + buffer_.size()); }
  void flush() {
    put(pbase(), pptr() - pbase());
    reset();
  }
  void put(const char* data, std::streamsize size) {
    try {
      if (!failure_) file_.write(data, static_cast<std::size_t>(size), start_);
    } catch (const IoError&) {
      failure_ = std::current_exception();
    }
    start_ += size;
    end_ = std::max(end_, start_);
  }

  TemporaryFile& file_;
  std::vector<char> buffer_;
  off_type start_ = 0;  ///< place of the buffer's first character
  off_type end_ = 0;
  std::exception_ptr failure_;
};

/// VTK's writer, onto a stream buffer of ours.
class BufferWriter : public vtkXMLUnstructuredGridWriter {
 public:
  static BufferWriter* New();
  void set_buffer(std::streambuf* buffer) {
    buffer_ = buffer;
    WriteToOutputStringOn();
  }

 protected:
  int StartFile() override {
    Stream->rdbuf(buffer_);
    return vtkXMLUnstructuredGridWriter::StartFile();
  }

 private:
  std::streambuf* buffer_ = nullptr;
};
vtkStandardNewMacro(BufferWriter)

    /// Blocks of more than 4 GiB need long headers, whatever the input had.
    bool needs_long_headers(vtkUnstructuredGrid* grid) {
  constexpr unsigned long kKibibytes = 1ul << 21;
  return grid->GetActualMemorySize() > kKibibytes;
}

template <class Writer>
void run_writer(Writer* writer, const fs::path& target) {
  SilentVtk vtk;
  const bool is_written = writer->Write() != 0;
  if (!is_written || vtk.has_errors() || writer->GetErrorCode() != vtkErrorCode::NoError)
    fail_writing(target, vtk.first_error());
}

void write_xml(vtkUnstructuredGrid* grid, const Layout& layout, const fs::path& target,
               TemporaryFile& file) {
  FileBuffer buffer(file);
  vtkNew<BufferWriter> writer;
  writer->set_buffer(&buffer);
  writer->SetInputData(grid);
  writer->SetDataMode(layout.data_mode);
  writer->SetCompressorType(layout.compressor);
  writer->SetEncodeAppendedData(layout.is_appended_base64);
  writer->SetHeaderType(layout.has_long_headers || needs_long_headers(grid) ? vtkXMLWriter::UInt64
                                                                            : vtkXMLWriter::UInt32);
  run_writer(writer.Get(), target);
  buffer.finish();
}

void write_legacy(vtkUnstructuredGrid* grid, const Layout& layout, const fs::path& target,
                  TemporaryFile& file) {
  vtkNew<vtkUnstructuredGridWriter> writer;
  writer->SetInputData(grid);
  writer->SetFileTypeToBinary();  // VTK writes but 11 digits in ascii
  writer->SetFileVersion(layout.legacy_version);
  writer->WriteToOutputStringOn();
  run_writer(writer.Get(), target);
  file.write(writer->GetOutputString(), static_cast<std::size_t>(writer->GetOutputStringLength()),
             0);
}

void write_grid(vtkUnstructuredGrid* grid, const Layout& layout, const fs::path& path) {
  TemporaryFile file(path);
  const bool is_xml = path.extension() == ".vtu" || (layout.is_xml && path.extension() != ".vtk");
  if (is_xml)
    write_xml(grid, layout, path, file);
  else
    write_legacy(grid, layout, path, file);
  file.commit();
}

vtkSmartPointer<vtkIdTypeArray> to_vtk(const std::vector<Index>& values) {
  auto array = vtkSmartPointer<vtkIdTypeArray>::New();
  array->SetNumberOfValues(std::ssize(values));
  std::ranges::copy(values, array->GetPointer(0));
  return array;
}

/// Sets the cells with VTK's form of polyhedron faces: the number of faces before them.
void set_cells(const Mesh& mesh, vtkUnstructuredGrid* grid) {
  vtkNew<vtkUnsignedCharArray> types;
  for (CellType type : mesh.types) types->InsertNextValue(static_cast<unsigned char>(type));
  vtkNew<vtkCellArray> cells;
  cells->SetData(to_vtk(mesh.offsets), to_vtk(mesh.connectivity));
  if (mesh.polyhedron_faces.empty()) {
    grid->SetCells(types, cells);
    return;
  }
  std::vector<Index> locations, faces;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    const Index end = mesh.polyhedron_offsets[c + 1];
    const bool is_polyhedron = mesh.types[c] == CellType::Polyhedron;
    locations.push_back(is_polyhedron ? std::ssize(faces) : -1);
    if (!is_polyhedron) continue;
    const auto count = faces.size();
    faces.push_back(0);
    for (Index at = mesh.polyhedron_offsets[c]; at < end; at += mesh.polyhedron_faces[at] + 1)
      ++faces[count];
    faces.insert(faces.end(), mesh.polyhedron_faces.begin() + mesh.polyhedron_offsets[c],
                 mesh.polyhedron_faces.begin() + end);
  }
  grid->SetCells(types, cells, to_vtk(locations), to_vtk(faces));
}

}  // namespace

struct MeshFile::Impl {
  fs::path path;
  Grid grid;
  Layout layout;
  Mesh mesh;
};

MeshFile::MeshFile(const fs::path& path) : impl_(std::make_unique<Impl>()) {
  impl_->path = path;
  std::tie(impl_->grid, impl_->layout) = read_grid(path);
  impl_->mesh = to_mesh(impl_->grid, path);
}

MeshFile::~MeshFile() = default;
MeshFile::MeshFile(MeshFile&&) noexcept = default;
MeshFile& MeshFile::operator=(MeshFile&&) noexcept = default;

const Mesh& MeshFile::mesh() const { return impl_->mesh; }

const fs::path& MeshFile::path() const { return impl_->path; }

void MeshFile::write(const fs::path& path, const Points& points, const ExtraArrays& extra) const {
  check_rows("coordinates", points.rows(), impl_->mesh.node_count());
  if (!points.allFinite())
    throw InvalidInputError("the coordinates to write to " + path.string() + " are not all finite");
  vtkNew<vtkUnstructuredGrid> grid;
  grid->ShallowCopy(impl_->grid);
  grid->SetPoints(to_vtk(points));
  add_extra(grid, extra);
  write_grid(grid, impl_->layout, path);
}

void write_mesh(const fs::path& path, const Mesh& mesh, const ExtraArrays& extra) {
  vtkNew<vtkUnstructuredGrid> grid;
  grid->SetPoints(to_vtk(mesh.points));
  set_cells(mesh, grid);
  ExtraArrays arrays = extra;
  if (!mesh.regions.empty())
    arrays.cell_integers.emplace(mesh.region_array.empty() ? "RegionId" : mesh.region_array,
                                 mesh.regions);
  add_extra(grid, arrays);
  write_grid(grid, {.compressor = vtkXMLWriter::ZLIB}, path);
}

}  // namespace cadmorph
