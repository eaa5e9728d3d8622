// vtk_round_trip IN.vtu OUT.vtu: reads and writes an unstructured grid with VTK, and nothing else.

#include <vtkNew.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUnstructuredGridReader.h>
#include <vtkXMLUnstructuredGridWriter.h>

int main(int argc, char** argv) {
  if (argc != 3) return 1;
  vtkNew<vtkXMLUnstructuredGridReader> reader;
  reader->SetFileName(argv[1]);
  reader->Update();
  vtkNew<vtkXMLUnstructuredGridWriter> writer;
  writer->SetFileName(argv[2]);
  writer->SetInputData(reader->GetOutput());
  return writer->Write() == 1 ? 0 : 1;
}
