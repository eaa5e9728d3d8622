// vtk_round_trip IN.vtu OUT.vtu [raw]: reads and writes an unstructured grid with VTK, and nothing
// else; raw: without compression.

#include <vtkNew.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUnstructuredGridReader.h>
#include <vtkXMLUnstructuredGridWriter.h>

#include <string_view>

int main(int argc, char** argv) {
  if (argc < 3) return 1;
  vtkNew<vtkXMLUnstructuredGridReader> reader;
  reader->SetFileName(argv[1]);
  reader->Update();
  vtkNew<vtkXMLUnstructuredGridWriter> writer;
  writer->SetFileName(argv[2]);
  writer->SetInputData(reader->GetOutput());
  if (argc > 3 && std::string_view(argv[3]) == "raw") {
    writer->SetCompressorTypeToNone();
    writer->EncodeAppendedDataOff();
  }
  return writer->Write() == 1 ? 0 : 1;
}
