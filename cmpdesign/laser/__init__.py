"""What a laser job needs to know besides the layout: options, machines, materials, measured kerf."""
