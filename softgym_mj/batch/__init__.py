"""What environments stepped together share: their arrays, who steps them, the GPU launcher."""
