class TableSource:
    name="table"; version=1
    def __init__(self, columns=None): pass
    def recognises(self, path, head): return False
    def read(self, path, data, sheet=None): raise NotImplementedError
