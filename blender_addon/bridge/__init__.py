"""The only access to ``bpy.data``: arrays and descriptions become images, materials, lamps, meshes."""
