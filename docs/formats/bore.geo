// The block with a hole, meshed with names for its parts.
Merge "../../models/bore/base.step";
Physical Volume("block") = Volume{:};
Physical Surface("foot") = Surface In BoundingBox{-1e3, -1e3, -1e-3, 1e3, 1e3, 1e-3};
Physical Surface("skin") = Surface{:};
Mesh.CharacteristicLengthMax = 12;
Mesh.SaveGroupsOfNodes = 1; // node sets in .inp
Mesh.SecondOrderLinear = 1; // straight edges
